"""Who asks, and what they may: scopes, and the collections that a key is bound to."""

from dataclasses import dataclass
from enum import StrEnum
from fnmatch import fnmatchcase


class Scope(StrEnum):
    """What a key allows; none includes another."""

    READ = "read"
    WRITE = "write"
    ADMIN = "admin"


@dataclass(frozen=True, slots=True)
class Caller:
    """Whoever sent a request.

    Attributes:
        id: public part of the key, empty where the service asks for none.
        scopes: what may be done.
        patterns: which collections exist for this caller, by shell pattern (`plots-*`); all others do not.
    """

    id: str
    scopes: frozenset[Scope]
    patterns: tuple[str, ...]

    def may(self, scope: Scope) -> bool:
        """Whether the caller has the scope."""
        return scope in self.scopes

    def sees(self, collection_id: str) -> bool:
        """Whether the collection exists for the caller."""
        return any(fnmatchcase(collection_id, pattern) for pattern in self.patterns)

    @property
    def sees_all(self) -> bool:
        """Whether every collection, present and future, exists for the caller."""
        return "*" in self.patterns


ANYBODY = Caller("", frozenset(Scope), ("*",))
"""The caller of a service that asks for no key."""
