"""The attacks: what each stores before, what it asks for, and how often."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final

from benchmarks.reliability.exhaustion import connections, requests
from benchmarks.reliability.exhaustion.attack_outcome import AttackOutcome
from benchmarks.reliability.exhaustion.attacked_service import AttackedService

Prepare = Callable[..., None]
Strike = Callable[..., AttackOutcome]


def _nothing(attacked: AttackedService, *, quick: bool) -> None:
    requests.collection(attacked)


@dataclass(frozen=True, slots=True)
class Attack:
    """One way to ask for too much.

    Attributes:
        does: what the attacker does, for the page.
        strike: does it for at least so many seconds.
        prepare: what is stored before.
        limits: settings of the service, and `descriptors`, the limit of open files that it is started with.
    """

    does: str
    strike: Strike
    prepare: Prepare = _nothing
    limits: Mapping[str, str] = field(default_factory=dict)


ATTACKS: Final[dict[str, Attack]] = {
    "equal points": Attack("PUT of 20,000 equal points, 227 bytes of gzip", requests.equal_points),
    "equal points in an import": Attack(
        "an import of 100 lines, one of them 20,000 equal points", requests.poisoned_line
    ),
    "shapes": Attack(
        "20,000 trees on a circle, a fan, a spiral, two lattices: stored, and asked for among their like",
        requests.shapes,
    ),
    "large answers": Attack(
        "batches of queries by `submap_id` on submaps of thousands of trees, every pair asked for",
        requests.large_answers,
        requests.store_large,
    ),
    "unread answers": Attack(
        "150 connections that ask for large answers and never read them",
        connections.unread,
        requests.store_large,
    ),
    "one key": Attack("40 slow queries at a time with one key", requests.crowd, requests.store_lattices),
    "revoked key": Attack("the same, and the key is revoked in the middle", requests.revoked, requests.store_lattices),
    "abandoned batches": Attack(
        "batches of 200 slow queries whose caller hangs up after half a second",
        connections.abandoned,
        requests.store_lattices,
    ),
    "waits": Attack("thousands of `GET /v1/jobs/ID?wait=60` at a time", connections.waits, requests.store_jobs),
    "jobs": Attack("as many constraints jobs as the service takes, and then an import by the robot", requests.jobs),
    "connections": Attack(
        "1,100 connections to a service that may open 1,024 files", connections.many, limits={"descriptors": "1024"}
    ),
    "empty lines": Attack("an import of 13,000 lines `{}`, 39 kB", requests.empty_lines),
}
