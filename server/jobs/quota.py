"""How many unfinished jobs a caller may have, and whose jobs are accepted at all."""

from sqlalchemy.orm import Session

from server.config.settings import Limits
from server.errors import TooManyJobs, Unauthorized
from server.security.principal import Principal
from server.store.repositories.api_keys import ApiKeys
from server.store.repositories.jobs import Jobs
from server.store.sqlite.database import Database


def check_quota(session: Session, caller: Principal, limits: Limits) -> None:
    """Refuse a job of a caller who has as many as may wait. Raises TooManyJobs.

    In the transaction that takes the job on, the count cannot be outrun by requests that come at once.
    """
    if Jobs(session).unfinished_of(caller.id) >= limits.unfinished_jobs:
        raise TooManyJobs(limits.unfinished_jobs)


def check_key(session: Session, caller: Principal) -> None:
    """Refuse a job of a key that was revoked after the caller was let in. Raises Unauthorized."""
    row = ApiKeys(session).get(caller.id) if caller.id else None
    if row is not None and row.revoked is not None:
        raise Unauthorized(f"The key {caller.id} is revoked. Ask the operator for another.")


def check_room(database: Database, caller: Principal, limits: Limits) -> None:
    """The same before an upload is sent, which would be for nothing. Raises TooManyJobs and StorageError."""
    with database.read() as session:
        check_quota(session, caller, limits)
