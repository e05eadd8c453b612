"""Several queries in one request, each answered as if it were alone."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from server.collections.crud import get_collection
from server.errors import DeadlineExceeded, DomainError, KeyReused, TooLarge
from server.parsing.field_errors import invalid_body
from server.problem_types import document
from server.queries.answers import carried
from server.queries.lookup import QueryContext, answer_as_json, answer_query, shown
from server.queries.query import PlaceQuery
from server.queries.stored_queries import AnswerKey, kept_answer
from server.resources.idempotency import IdempotencyKey
from server.schemas.common import to_json
from server.schemas.queries import BatchInput, BatchProblem, QueryInput
from server.security.principal import Principal, Scope
from urquhart import Budget


class Shares:
    """Landmark pairs for several answers: each gets an equal share of the rest, so that none uses up all of it."""

    def __init__(self, most: int, answers: int) -> None:
        self._left, self._answers = most, answers

    def next(self) -> int:
        """The share of the next answer."""
        return self._left // max(self._answers, 1)

    def used(self, pairs: int) -> None:
        """Record the number of pairs in that answer."""
        self._left -= pairs
        self._answers -= 1


def answer_batch(
    context: QueryContext,
    caller: Principal,
    collection_id: str,
    body: BatchInput,
    budget: Budget,
    idempotency_key: IdempotencyKey | None = None,
) -> list[bytes]:
    """Answer queries one after the other. Each result is JSON: an answer, or the problem of an invalid query.

    Each query has its own deadline, and the batch has one: `limits.batch_seconds` or `timeout_ms` after the budget
    began. A query that has not begun by then has the problem `DeadlineExceeded`.

    An answer with `store` is stored under the idempotency key and its position, so a repeated batch resumes where the
    first attempt ended.

    Raises NotFound (the collection), TooLarge (more than `limits.batch_queries`), KeyReused, StorageError, and
    Abandoned.
    """
    limits = context.limits
    if len(body.queries) > limits.batch_queries:
        raise TooLarge("batch_queries", limits.batch_queries, len(body.queries), "Send the queries in several batches.")
    with context.database.read() as tx:
        get_collection(tx, collection_id)
    seconds = limits.batch_seconds if body.timeout_ms is None else min(limits.batch_seconds, body.timeout_ms / 1000.0)
    whole = budget.within(seconds - budget.elapsed)
    late = document(DeadlineExceeded("batch_seconds", seconds, "Send fewer queries at a time."))
    results: list[bytes] = []
    pairs = Shares(limits.answer_pairs, len(body.queries))
    for position, members in enumerate(body.queries, start=1):
        own = whole.within(limits.query_seconds)
        if own.is_spent():
            pairs.used(0)
            results.append(_problem(late))
            continue
        member = _Member(context, caller, collection_id, AnswerKey(idempotency_key, position), own)
        result, used = member.answer(members, pairs.next())
        pairs.used(used)
        results.append(result)
    return results


def _problem(problem: Mapping[str, Any]) -> bytes:
    return to_json(BatchProblem(problem=dict(problem)))


@dataclass(frozen=True, slots=True)
class _Member:
    """One query of a batch: its collection, its key, and the budget of its search."""

    context: QueryContext
    caller: Principal
    collection_id: str
    key: AnswerKey
    budget: Budget

    def answer(self, members: dict[str, Any], pairs: int) -> tuple[bytes, int]:
        """The answer with at most so many pairs of landmarks, or the query's problem: JSON, and the number of pairs.

        Raises KeyReused, and errors of the service, which concern the whole batch.
        """
        try:
            query = PlaceQuery.of(QueryInput.model_validate(members), self.context.limits)
            if not query.store:
                return answer_as_json(self.context, self.collection_id, query, pairs=pairs, budget=self.budget)
            self.caller.require(Scope.WRITE)
            answer = kept_answer(self.context.database, self.collection_id, self.key)
            if answer is not None:
                answer = shown(answer, query, pairs)
            else:
                answer = answer_query(
                    self.context, self.collection_id, query, key=self.key, pairs=pairs, budget=self.budget
                )
            return to_json(answer), carried(answer)
        except KeyReused:
            raise
        except ValidationError as error:
            return _problem(document(invalid_body(error))), 0
        except DomainError as error:
            problem = document(error)
            if problem["status"] >= 500:
                raise
            return _problem(problem), 0
