"""How many unfinished jobs a caller may have, and which callers may start jobs."""

from server.config.settings import Limits
from server.errors import TooManyJobs, Unauthorized
from server.security.principal import Principal
from server.store.storage import ReadTransaction, Storage


def check_quota(tx: ReadTransaction, caller: Principal, limits: Limits) -> None:
    """Refuse a job of a caller with too many unfinished ones. Raises TooManyJobs.

    Checked in the transaction that stores the job, so simultaneous requests cannot exceed the limit.
    """
    if tx.jobs.unfinished_of(caller.id) >= limits.unfinished_jobs:
        raise TooManyJobs(limits.unfinished_jobs)


def check_key(tx: ReadTransaction, caller: Principal) -> None:
    """Refuse a job if its key was revoked after the caller was admitted. Raises Unauthorized."""
    row = tx.api_keys.get(caller.id) if caller.id else None
    if row is not None and row.revoked is not None:
        raise Unauthorized(f"The key {caller.id} is revoked. Ask the operator for another.")


def check_room(database: Storage, caller: Principal, limits: Limits) -> None:
    """Check the quota before an upload, which would be in vain. Raises TooManyJobs and StorageError."""
    with database.read() as tx:
        check_quota(tx, caller, limits)
