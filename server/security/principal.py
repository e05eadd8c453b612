"""The principal behind a request, and what it may do: scopes, and the collections that a key is bound to."""

from dataclasses import dataclass
from enum import StrEnum
from fnmatch import fnmatchcase

from server.errors import Forbidden


class Scope(StrEnum):
    """A scope of a key. No scope includes another."""

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
        """Whether the principal may know that the collection exists."""
        return any(fnmatchcase(collection_id, pattern) for pattern in self.patterns)

    def require(self, scope: Scope) -> None:
        """Raise Forbidden for a principal without the scope."""
        if scope not in self.scopes:
            raise Forbidden(f"This needs a key with the scope {scope.value}. Yours has {_listed(self.scopes)}.")

    def require_all(self) -> None:
        """Raise Forbidden for a principal that may see only some collections."""
        if not self.sees_all:
            raise Forbidden("This needs a key for all collections. Yours is bound to some of them.")

    @property
    def sees_all(self) -> bool:
        """Whether the principal may see every collection, present and future."""
        return "*" in self.patterns


UNRESTRICTED = Principal("", frozenset(Scope), ("*",))
"""The principal of every request while the service needs no key."""
ANONYMOUS = Principal("", frozenset(), ())
"""A caller without a key while the service needs one."""


def _listed(scopes: frozenset[Scope]) -> str:
    return " and ".join(sorted(scope.value for scope in scopes)) or "none"
