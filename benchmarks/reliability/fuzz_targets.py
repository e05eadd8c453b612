"""The readers under test, each with good inputs of its own and the errors that it may answer with."""

import importlib
import pkgutil
import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple

import orjson
from pydantic import BaseModel, ValidationError

import server.schemas
from benchmarks.reliability.fuzz_inputs import NAMES, changed, damaged, dumped, value
from benchmarks.reliability.trees import body
from server.collections import crud
from server.config.settings import Limits
from server.errors import DomainError
from server.parsing.field_errors import field_problems
from server.platform.thread_limits import pin_threads
from server.resources.paging import read_cursor, read_name_cursor
from server.schemas.collections import CollectionPut
from server.schemas.common import Body
from server.stem_maps.reader import StemMapError, read_stem_map
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade import migrations_runner
from server.submaps import described_batches
from server.submaps.reader import submap_filter
from urquhart import Config, warm_up


class Reader(NamedTuple):
    """What is fed.

    Attributes:
        draw: makes an input.
        read: reads it; the name of the error of the domain that came out, None when it was good. Anything else that
            comes out is a finding.
    """

    draw: Callable[[random.Random], Any]
    read: Callable[[Any], str | None]


_TREE: Final[Any] = {"id": "t1", "x": 1.2, "y": 3.4, "dbh_cm": 31.0, "height_m": 18.5, "species": "Picea abies"}
_POSE: Final[Any] = {"frame_id": "map", "x": 120.5, "y": 88.25, "yaw": 0.31, "covariance": [1, 0, 0, 0, 1, 0, 0, 0, 1]}
_GOOD: Final[list[Any]] = [
    {"id": "p1", **body(1)},
    {"id": "p2", "xy": [[0, 0], [5, 1], [2, 7], [9, 9]], "ids": ["a", "b", "c", "d"]},
    {
        "id": "p3",
        "landmarks": [_TREE, {"x": 4.9, "y": -2.2}, {"id": "t3", "x": -3.1, "y": 0.7}, {"x": 2.0, "y": 9.0}],
        "stamp": "2026-05-04T09:30:00Z",
        "session": "monday",
        "frame_id": "plot",
        "map_pose": _POSE,
        "properties": {"observer": {"name": "robot", "legs": [1, 2, 3]}},
    },
    {"xy": [[0, 0], [5, 1], [2, 7]], "limit": 5, "seed": 7, "explain": True, "store": False, "method": "paper"},
    {"submap_id": "p1", "near": {"x": 1, "y": 2, "radius": 30}, "exclude": {"session": "a", "within_seconds": 3.5}},
    {"title": "Plots", "crs": "EPSG:32633", "origin": {"x": 500000, "y": 5000000}, "config": {"gate": 0.999}},
    {"map_pose": _POSE, "properties": None},
]
_CSV: Final = [
    b"tree_id,x_m,y_m,dbh_cm,height_m,species\n1,0.5,1.5,31.0,18.5,spruce\n2,7.25,-3,,,\n# note\n\n3,1e1,9,22,,oak\n",
    b"x,y\n" + b"".join(b"%d,%d\n" % (3 * i % 31, 7 * i % 29) for i in range(40)),
    b'\xef\xbb\xbfid,X_M,Y_M,species\r\n"a, b",1,2,"A ""quoted"" name"\r\nc,4,5,x\r\n',
    b"id;x;y\n1;2;3\n",
]
_PARAMETERS: Final = ["0,0,100,100", "2026-05-01T00:00:00Z/..", "WyJzdWJtYXBzIiwxXQ", "WyJzZXNzaW9ucyIsImEiXQ"]


@contextmanager
def lines(folder: Path) -> Iterator[Reader]:
    """NDJSON: batches of lines as bulk ingest reads, checks and describes them."""
    database = Database(folder / "lines.db")
    migrations_runner.upgrade(database)
    crud.ensure(database, "plots", CollectionPut())
    pin_threads()
    warm_up(Config())
    work = described_batches.of_lines(database, "plots", Limits())

    def read(line: bytes) -> str | None:
        described = work.here(described_batches.Batch([(0, line)], 1))
        return type(described.refused[0].error).__name__ if described.refused else None

    try:
        yield Reader(lambda rng: _json(rng, _GOOD[:3]), read)
    finally:
        database.dispose()


@contextmanager
def bodies(folder: Path) -> Iterator[Reader]:
    """JSON bodies of every route, and what is told of those that are wrong."""
    fitting = [(model, [good for good in _GOOD if _fits(model, good)] or _GOOD) for model in _models()]

    def draw(rng: random.Random) -> tuple[type[BaseModel], bytes]:
        model, goods = rng.choice(fitting)
        return model, _json(rng, goods)

    def read(given: tuple[type[BaseModel], bytes]) -> str | None:
        model, raw = given
        try:
            read_in = model.model_validate(orjson.loads(raw))
        except orjson.JSONDecodeError:
            return "JSONDecodeError"
        except ValidationError as error:
            orjson.dumps(field_problems([{**one, "loc": ("body", *one["loc"])} for one in error.errors()]))
            return "ValidationError"
        read_in.model_dump_json()
        return None

    yield Reader(draw, read)


@contextmanager
def stem_maps(folder: Path) -> Iterator[Reader]:
    """Stem maps as CSV files."""
    path = folder / "map.csv"

    def read(data: bytes) -> str | None:
        path.write_bytes(data)
        try:
            read_stem_map(path)
        except StemMapError:
            return "StemMapError"
        return None

    yield Reader(_csv, read)


@contextmanager
def parameters(folder: Path) -> Iterator[Reader]:
    """Query parameters: cursors, boxes, intervals."""

    calls: list[Callable[[str], object]] = [
        lambda text: submap_filter(session=None, bbox=text, frame_id=None, datetime_range=None),
        lambda text: submap_filter(session=text, bbox=None, frame_id=text, datetime_range=text),
        lambda text: read_cursor("submaps", text),
        lambda text: read_name_cursor("sessions", text),
    ]

    def draw(rng: random.Random) -> tuple[int, str]:
        which = rng.randrange(len(calls))
        good = _PARAMETERS[which].encode()
        return which, damaged(rng, good, rng.choice(_PARAMETERS).encode()).decode(errors="replace")

    def read(given: tuple[int, str]) -> str | None:
        which, text = given
        try:
            calls[which](text)
        except DomainError as error:
            return type(error).__name__
        return None

    yield Reader(draw, read)


READERS: Final = {"lines": lines, "bodies": bodies, "stem maps": stem_maps, "parameters": parameters}


def _fits(model: type[BaseModel], good: Any) -> bool:
    try:
        model.model_validate(good)
    except ValidationError:
        return False
    return True


def _json(rng: random.Random, goods: list[Any]) -> bytes:
    good = rng.choice(goods)
    match rng.randrange(4):
        case 0:
            return damaged(rng, orjson.dumps(good), orjson.dumps(rng.choice(_GOOD)))
        case 1:
            return dumped({rng.choice(NAMES): value(rng) for _ in range(rng.randrange(6))} | {"id": "p"})
        case _:
            return dumped(changed(rng, good))


def _csv(rng: random.Random) -> bytes:
    if rng.random() < 0.7:
        return damaged(rng, rng.choice(_CSV), rng.choice(_CSV))
    names = [
        rng.choice(("tree_id", "x_m", "y_m", "x", "y", "dbh", "species", "", "X")) for _ in range(rng.randrange(6))
    ]
    rows = [
        ",".join(str(value(rng, 9)) for _ in range(max(0, len(names) + rng.choice((0, 0, 0, 1, -1)))))
        for _ in range(rng.randrange(5))
    ]
    return "\n".join([",".join(["x_m", "y_m", *names]), *rows]).encode(errors="surrogatepass")


def _models() -> list[type[BaseModel]]:
    """All models of bodies, of whatever module."""
    for module in pkgutil.iter_modules(server.schemas.__path__):
        importlib.import_module(f"server.schemas.{module.name}")
    found, looked_at = list[type[BaseModel]](), list[type[BaseModel]]([Body])
    while looked_at:
        model = looked_at.pop()
        looked_at += model.__subclasses__()
        if not issubclass(model, server.schemas.common.Answer):
            found.append(model)
    return sorted(set(found), key=lambda model: model.__name__)
