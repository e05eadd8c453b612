"""Several queries in one request, each answered as if it had come alone."""

from pydantic import ValidationError

from server.collections.registry import get_collection
from server.config.settings import Limits
from server.errors import DomainError, KeyReused, OutOfTime, TooLarge
from server.index.catalog import Catalog
from server.observability.metrics import Metrics
from server.parsing.field_errors import invalid_body
from server.problem_types import document
from server.queries.answers import Shares, carried
from server.queries.lookup import answer_query, shown
from server.queries.stored import kept_answer
from server.resources.idempotency import IdempotencyKey
from server.schemas.queries import BatchAnswer, BatchInput, BatchProblem, QueryAnswer, QueryInput
from server.security.principal import Principal, Scope
from server.store.sqlite.database import Database
from urquhart import Budget


def answer_batch(
    database: Database,
    catalog: Catalog,
    metrics: Metrics,
    limits: Limits,
    caller: Principal,
    collection_id: str,
    body: BatchInput,
    budget: Budget,
    idempotency_key: IdempotencyKey | None = None,
) -> BatchAnswer:
    """Look queries up one after the other; what is wrong with one stands in its place.

    Each query has its own deadline, and the batch one for all, `limits.batch_seconds` or `timeout_ms` after the budget
    began. A query that is not begun by then has the problem `OutOfTime` in its place.

    Each answer that is to be stored is kept under `once` and its position: a batch that is sent again goes on where
    the first attempt ended.

    Raises NotFound (the collection), TooLarge (more than `limits.batch_queries`), KeyReused, StorageError, and
    Abandoned.
    """
    if len(body.queries) > limits.batch_queries:
        raise TooLarge("batch_queries", limits.batch_queries, len(body.queries), "Send them in parts.")
    with database.read() as session:
        get_collection(session, collection_id)
    seconds = limits.batch_seconds if body.timeout_ms is None else min(limits.batch_seconds, body.timeout_ms / 1000.0)
    whole = budget.within(seconds - budget.elapsed)
    late = document(OutOfTime("batch_seconds", seconds, "Send fewer queries at a time."))
    results: list[QueryAnswer | BatchProblem] = []
    pairs = Shares(limits.answer_pairs, len(body.queries))
    for position, members in enumerate(body.queries, start=1):
        own = whole.within(limits.query_seconds)
        if own.is_spent():
            pairs.used(0)
            results.append(BatchProblem(problem=late))
            continue
        share = pairs.next()
        try:
            query = QueryInput.model_validate(members)
            if query.store:
                caller.require(Scope.WRITE)
            response = kept_answer(database, collection_id, idempotency_key, position) if query.store else None
            answer = (
                answer_query(
                    database,
                    catalog,
                    metrics,
                    limits,
                    collection_id,
                    query,
                    idempotency_key=idempotency_key,
                    position=position,
                    pairs=share,
                    budget=own,
                )
                if response is None
                else shown(response, query, share)
            )
            pairs.used(carried(answer))
            results.append(answer)
        except KeyReused:
            raise
        except ValidationError as error:
            pairs.used(0)
            results.append(BatchProblem(problem=document(invalid_body(error))))
        except DomainError as error:
            problem = document(error)
            if problem["status"] >= 500:
                raise
            pairs.used(0)
            results.append(BatchProblem(problem=problem))
    return BatchAnswer(results=results)
