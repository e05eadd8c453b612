"""The house as drawn in docs/architecture.md: arrows one way, files short, public names explained."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("urquhart", "server", "clients/python/urquhart_client", "benchmarks")

METHOD = [
    *(
        "_kernel",
        "budget",
        "config",
        "stages",
        "landmarks",
        "se2",
        "uncertainty",
        "delaunay",
        "distortion",
        "quads",
        "tessellation",
        "descriptor",
        "features",
        "diameters",
    ),
    *(
        "grid",
        "pairing",
        "verification",
        "polygon_partition",
        "polygon_scan",
        "polygon_merge",
        "polygon_index",
        "voting",
    ),
    *("quad_table", "quad_search", "quad_votes", "consensus", "segment_file", "segment", "submaps", "collection_index"),
    *("matching", "ransac", "sweep"),
    *(
        "proposing",
        "confidence",
        "rivals",
        "ranking",
        "doubt",
        "levels",
        "recognizer",
        "warming",
        "drawing",
        "explaining",
        "simulation",
        "evaluation",
        "merging",
    ),
]
"""Modules of the method from the ground up: each may import only what stands before it."""

FORBIDDEN = {
    "urquhart": {"server", "fastapi", "starlette", "sqlalchemy", "pydantic", "alembic", "typer", "rich", "benchmarks"},
    "clients/python/urquhart_client": {"server", "urquhart", "fastapi", "sqlalchemy", "numpy"},
    "server/store": {"fastapi", "starlette", "typer", "rich"},
    "server/routes": {"sqlalchemy", "numpy", "server.store"},
    "migrations": {"urquhart", "fastapi"},
}


def sources(*folders: str) -> Iterator[Path]:
    for folder in folders:
        yield from sorted((ROOT / folder).rglob("*.py"))


def imports(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            found |= {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def test_the_method_stands_on_what_is_below_it() -> None:
    modules = {path.stem for path in (ROOT / "urquhart").glob("*.py")} - {"__init__"}
    assert modules == set(METHOD)
    for level, name in enumerate(METHOD):
        for imported in imports(ROOT / "urquhart" / f"{name}.py"):
            if imported.startswith("urquhart.") and (part := imported.split(".")[1]) in METHOD:
                assert METHOD.index(part) < level, f"{name} imports {part}"


@pytest.mark.parametrize("folder", FORBIDDEN)
def test_no_arrow_goes_back(folder: str) -> None:
    paths = list(sources(folder))
    assert paths
    for path in paths:
        for imported in imports(path):
            for name in FORBIDDEN[folder]:
                assert not f"{imported}.".startswith(f"{name}."), f"{path.relative_to(ROOT)}: {imported}"


def test_only_the_edge_knows_the_web_framework() -> None:
    edge = [ROOT / "server" / part for part in ("app.py", "http", "routes", "commands")]
    for path in sources("server"):
        if not any(path == part or part in path.parents for part in edge):
            assert not {name.split(".")[0] for name in imports(path)} & {"fastapi", "starlette"}, path.relative_to(ROOT)


def test_files_are_short_enough_to_read() -> None:
    long = {
        str(path.relative_to(ROOT)): lines
        for path in sources(*PACKAGES)
        if (lines := len(path.read_text().splitlines())) > 300
    }
    assert not long


def test_every_public_name_is_explained() -> None:
    bare = [
        f"{path.relative_to(ROOT)}: {node.name}"
        for path in sources(*PACKAGES)
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
        and not node.name.startswith("_")
        and not ast.get_docstring(node)
    ]
    assert not bare


def test_every_module_says_what_it_is_for() -> None:
    bare = [
        str(path.relative_to(ROOT)) for path in sources(*PACKAGES) if not ast.get_docstring(ast.parse(path.read_text()))
    ]
    assert not bare


def test_nothing_is_left_unfinished() -> None:
    marks = re.compile(r"\b(TODO|FIXME|XXX|NotImplementedError)\b")
    assert not [str(path) for path in sources(*PACKAGES, "migrations") if marks.search(path.read_text())]


def test_the_map_of_the_house_names_every_room() -> None:
    text = (ROOT / "docs/architecture.md").read_text()
    rooms = [path.stem for path in sources("urquhart", "server") if path.stem != "__init__"]
    missing = sorted({room for room in rooms if not re.search(rf"\b{room}\b", text)})
    assert not missing
