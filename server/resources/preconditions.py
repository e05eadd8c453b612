"""If-Match and If-None-Match, checked against the stored entity tag."""

from collections.abc import Sequence
from dataclasses import dataclass

from server.errors import PreconditionFailed


@dataclass(frozen=True, slots=True)
class Preconditions:
    """Entity tags, without quotes, of If-Match and If-None-Match; ("*",) for any, None if the header is missing."""

    if_match: Sequence[str] | None = None
    if_none_match: Sequence[str] | None = None

    def check(self, etag: str | None) -> None:
        """Raise PreconditionFailed unless a write may replace what has `etag` (None: nothing is stored)."""
        if self.if_match is not None and (etag is None or not _holds(self.if_match, etag)):
            found = "there is nothing here yet" if etag is None else f'it is now "{etag}"'
            raise PreconditionFailed(
                f"If-Match does not hold: {found}. Read the resource again before you write.", etag
            )
        if self.if_none_match is not None and etag is not None and _holds(self.if_none_match, etag):
            raise PreconditionFailed(
                f'If-None-Match does not hold: something is stored here already, with ETag "{etag}". '
                "Use another id, or leave out the header to replace it.",
                etag,
            )


def _holds(tags: Sequence[str], etag: str) -> bool:
    return "*" in tags or etag in tags


ANYTHING = Preconditions()
