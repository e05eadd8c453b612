"""The principal behind a request, and what it may do: scopes, and the collections that a key is bound to."""

from dataclasses import dataclass
from enum import StrEnum
from fnmatch import fnmatchcase

from server.errors import Forbidden


class Scope(StrEnum):
    """What a key allows; none includes another."""

    READ = "read"
    WRITE = "write"
    ADMIN = "admin"


@dataclass(frozen=True, slots=True)
class Principal:
    """The caller behind a request, as identified by the API key.

    Attributes:
        id: public part of the key, empty where the service asks for none.
        scopes: what may be done.
        patterns: which collections exist for this caller, by shell pattern (`plots-*`); all others do not.
    """

    id: str
    scopes: frozenset[Scope]
    patterns: tuple[str, ...]

    def sees(self, collection_id: str) -> bool:
        """Whether the collection exists for the caller."""
        return any(fnmatchcase(collection_id, pattern) for pattern in self.patterns)

    def require(self, scope: Scope) -> None:
        """Raise Forbidden for a caller without the scope."""
        if scope not in self.scopes:
            raise Forbidden(f"This needs a key with the scope {scope.value}. Yours has {_listed(self.scopes)}.")

    def require_all(self) -> None:
        """Raise Forbidden for a caller who sees only some collections."""
        if not self.sees_all:
            raise Forbidden("This needs a key for all collections. Yours is bound to some of them.")

    @property
    def sees_all(self) -> bool:
        """Whether every collection, present and future, exists for the caller."""
        return "*" in self.patterns


UNRESTRICTED = Principal("", frozenset(Scope), ("*",))
"""The principal of every request while the service requires no key."""
ANONYMOUS = Principal("", frozenset(), ())
"""A caller without a key where one is required."""


def _listed(scopes: frozenset[Scope]) -> str:
    return " and ".join(sorted(scope.value for scope in scopes)) or "none"
