"""A map as the results of a job: one document on each line."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, Final

import orjson

from server.maps.building import BuiltMap
from server.maps.documents import contradictions_of, edges_of, poses_of, summary_of, trees_of
from server.schemas.maps.answers import LandmarkEntry, MapContradiction, MapEdge, MapSubmapPose, MapSummary

_NEWER: Final = {"undecided": 0, "contradictions": 0}
"""What summaries of 0.2.0 have and earlier ones do not."""


@dataclass(slots=True)
class StoredMap:
    """A map as a job left it. Of the poses and trees, those of one part if only that was read."""

    summary: MapSummary | None = None
    poses: list[MapSubmapPose] = field(default_factory=list)
    constraints: list[MapEdge] = field(default_factory=list)
    contradictions: list[MapContradiction] = field(default_factory=list)
    trees: list[LandmarkEntry] = field(default_factory=list)


def lines_of_map(built: BuiltMap) -> Iterator[bytes]:
    """A line for the map in numbers, then for each pose, constraint, contradiction and tree; `of` says which it is."""
    yield _line("map", summary_of(built).model_dump(mode="json", by_alias=True))
    parts = (
        ("pose", poses_of(built)),
        ("constraint", edges_of(built)),
        ("contradiction", contradictions_of(built)),
        ("tree", trees_of(built)),
    )
    for of, rows in parts:
        for row in rows:
            yield _line(of, row.model_dump(mode="json", by_alias=True))


def refusals_of(built: BuiltMap) -> dict[int, str | None]:
    """Why the map left out the constraints that the collection keeps, by their keys; None for those that it used."""
    refusals = zip(built.edges, built.poses.refusals, strict=True)
    return {edge.row: reason for edge, reason in refusals if edge.row is not None}


def _line(of: str, document: dict[str, Any]) -> bytes:
    return orjson.dumps({"of": of} | document) + b"\n"


def read_map(lines: Iterable[bytes], *, trees: bool) -> StoredMap:
    """What `lines_of_map` wrote: its trees, or everything but these."""
    read = StoredMap()
    for line in lines:
        document = orjson.loads(line)
        match document.pop("of"):
            case "map":
                read.summary = MapSummary.model_validate(_NEWER | document)
            case "pose":
                read.poses.append(MapSubmapPose.model_validate(document))
            case "constraint" if not trees:
                read.constraints.append(MapEdge.model_validate(document))
            case "contradiction" if not trees:
                read.contradictions.append(MapContradiction.model_validate(document))
            case "tree" if trees:
                read.trees.append(LandmarkEntry.model_validate(document))
    return read
