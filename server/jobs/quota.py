"""How many unfinished jobs a caller may have, and which callers may start jobs."""

from sqlalchemy.orm import Session

from server.config.settings import Limits
from server.errors import TooManyJobs, Unauthorized
from server.security.principal import Principal
from server.store.repositories.api_keys import ApiKeys
from server.store.repositories.jobs import Jobs
from server.store.sqlite.database import Database


def check_quota(session: Session, caller: Principal, limits: Limits) -> None:
    """Refuse a job of a caller with too many unfinished ones. Raises TooManyJobs.

    Checked in the transaction that stores the job, so simultaneous requests cannot exceed the limit.
    """
    if Jobs(session).unfinished_of(caller.id) >= limits.unfinished_jobs:
        raise TooManyJobs(limits.unfinished_jobs)


def check_key(session: Session, caller: Principal) -> None:
    """Refuse a job if its key was revoked after the caller was admitted. Raises Unauthorized."""
    row = ApiKeys(session).get(caller.id) if caller.id else None
    if row is not None and row.revoked is not None:
        raise Unauthorized(f"The key {caller.id} is revoked. Ask the operator for another.")


def check_room(database: Database, caller: Principal, limits: Limits) -> None:
    """Check the quota before an upload, which would be in vain. Raises TooManyJobs and StorageError."""
    with database.read() as session:
        check_quota(session, caller, limits)
