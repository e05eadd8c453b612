"""The code is as docs/architecture describes it: imports go one way, files are short, public names are explained."""

import ast
import re
from collections import Counter
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("urquhart", "server", "clients/python/urquhart_client", "benchmarks")

FLOORS = (
    {"_kernel_loading", "_kernel", "budget", "config", "options", "se2", "trace", "pose_covariance"},
    {"features"},
    {"verify", "index", "mapping", "evaluation"},
    {"paper"},
    {"propose"},
    {"decide"},
    {"prior"},
    {"report", "recognizer", "warming", "hints"},
)
"""Rooms of the method (folders, and modules that stand alone) from the ground up: each may import from lower floors."""
MOST_FLOORS = 8
MOST_MODULES = 12
MOST_TESTS = 25
LONGEST_FUNCTION = 60
MOST_PARAMETERS = 6

SERVICE = (
    *("errors", "problem_types", "platform", "parsing", "config", "schemas"),
    *("store", "store.repositories", "store.storage", "store.sqlite"),
    *("store.sqlite.upgrade", "security", "observability", "resources"),
    *(
        "index",
        "collections",
        "outputs",
        "submaps",
        "queries",
        "queries.listing",
        "exports",
        "ogc",
        "constraints",
        "maps",
        "stem_maps.formats",
        "stem_maps.reading",
        "stem_maps",
        "coregistration",
        "coregistration.requests",
        "coregistration.outputs",
        "jobs",
        "jobs.types",
        "checks",
        "snapshots",
    ),
    *("console", "http", "http.admission", "service_parts", "http.documentation", "http.serving", "routes", "app"),
    *("commands.support", "commands.operator", "commands", "commands.demo", "cli", "__main__"),
)
"""Rooms of the service from the ground up: each may import from those before it."""

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


def module_name(path: Path) -> str:
    root = ROOT / "clients/python" if (ROOT / "clients/python") in path.parents else ROOT
    parts = path.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def arrows(package: str) -> dict[str, set[str]]:
    """Which modules of a package each of its modules imports; the package's own `__init__` is left out.

    `from room import module` imports the module; the room itself counts only if the name is defined there.
    """
    paths = {module_name(path): path for path in sources(package)}
    found: dict[str, set[str]] = {name: set() for name in paths if "." in name}
    for name in found:
        for node in ast.walk(ast.parse(paths[name].read_text())):
            if isinstance(node, ast.Import):
                found[name] |= {alias.name for alias in node.names} & paths.keys()
            elif isinstance(node, ast.ImportFrom) and node.module in paths:
                parts = {f"{node.module}.{alias.name}" for alias in node.names}
                found[name] |= parts & paths.keys() or {node.module}
    return found


def test_every_room_of_the_method_has_a_floor() -> None:
    rooms = {name.split(".")[1] for name in arrows("urquhart")}
    assert rooms == set().union(*FLOORS)
    assert sum(map(len, FLOORS)) == len(rooms)
    assert len(FLOORS) <= MOST_FLOORS


def test_the_method_imports_only_from_its_own_room_and_from_lower_floors() -> None:
    floor = {room: level for level, rooms in enumerate(FLOORS) for room in rooms}
    alone = {path.stem for path in (ROOT / "urquhart").glob("*.py")}
    for name, imported in arrows("urquhart").items():
        room = name.split(".")[1]
        assert "urquhart" not in imported, f"{name} imports the package that imports it"
        for other in {one.split(".")[1] for one in imported}:
            same_room = other == room or (floor[other] == floor[room] and {other, room} <= alone)
            assert floor[other] < floor[room] or same_room, f"{name} imports {other}"


def test_the_service_imports_only_from_its_own_room_and_from_those_below() -> None:
    def room_of(module: str) -> str:
        name = module.removeprefix("server.")
        return max((room for room in SERVICE if f"{name}.".startswith(f"{room}.")), key=len, default="")

    modules = arrows("server")
    assert {room_of(module) for module in modules} == set(SERVICE)
    upward = {
        f"{module} imports {imported}"
        for module, found in modules.items()
        for imported in found
        if SERVICE.index(room_of(imported)) > SERVICE.index(room_of(module))
    }
    assert not upward


@pytest.mark.parametrize("package", PACKAGES)
def test_no_import_is_circular(package: str) -> None:
    order = tuple(TopologicalSorter(arrows(package)).static_order())
    assert len(order) > 10


@pytest.mark.parametrize("package", ["urquhart", "server", "clients"])
def test_no_folder_is_flat(package: str) -> None:
    # `__init__` says what a room is for and is no module of its own.
    counts = Counter(path.parent for path in sources(package) if path.stem != "__init__")
    assert counts
    assert not {folder: count for folder, count in counts.items() if count > MOST_MODULES}


def test_tests_of_the_service_lie_as_its_rooms_do() -> None:
    rooms = {path.name for path in (ROOT / "server").iterdir() if path.is_dir()}
    counts = Counter(path.relative_to(ROOT / "tests/server").parts[0] for path in sources("tests/server"))
    folders = {name: count for name, count in counts.items() if not name.endswith(".py")}
    assert folders.keys() <= rooms
    assert max(folders.values()) <= MOST_TESTS
    assert not [name for name in counts if name.startswith("test_")]


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


def is_interface(path: Path, function: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    """Whether the parameters are those of a route or of a command, which name what callers give one by one."""
    if path.parent in (ROOT / "server/commands", ROOT / "server/commands/operator"):
        return not function.name.startswith("_")
    return any(ast.unparse(decorator).startswith("router.") for decorator in function.decorator_list)


def test_functions_are_short_and_take_few_parameters() -> None:
    found = []
    for path in sources("urquhart", "server"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                given = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
                count = len([one for one in given if one.arg not in ("self", "cls")])
                lines = (node.end_lineno or node.lineno) - node.lineno + 1
                if lines > LONGEST_FUNCTION or (count > MOST_PARAMETERS and not is_interface(path, node)):
                    found.append(f"{path.relative_to(ROOT)}: {node.name}, {lines} lines, {count} parameters")
    assert not found


def test_only_the_store_knows_tables_and_sql() -> None:
    inside = {
        "server.store.tables",
        "server.store.service_tables",
        "server.store.repositories.maps.constraint_tables",
        "server.store.columns",
        "sqlalchemy",
        "alembic",
    }
    outside = [path for path in sources("server", "benchmarks") if ROOT / "server/store" not in path.parents]
    found = [
        f"{path.relative_to(ROOT)}: {name}"
        for path in outside
        for name in imports(path)
        if name in inside or name.split(".")[0] in inside
    ]
    assert not found


def test_only_one_room_knows_sqlite() -> None:
    room = ROOT / "server/store/sqlite"
    marks = re.compile(
        r"^import sqlite3|^from sqlalchemy\.dialects|\bexec_driver_sql\b|\bPRAGMA [a-z]|\bjson_each\b", re.M
    )
    found = [path for path in sources("server") if room not in path.parents and marks.search(path.read_text())]
    assert not [str(path.relative_to(ROOT)) for path in found]


def test_only_those_who_open_the_database_know_which_it_is() -> None:
    openers = [
        ROOT / "server" / part for part in ("store", "checks", "snapshots", "commands", "app.py", "service_parts.py")
    ]
    for path in sources("server"):
        if not any(path == part or part in path.parents for part in openers):
            found = {name for name in imports(path) if name.startswith("server.store.sqlite")}
            assert not found, f"{path.relative_to(ROOT)}: {found}"


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


def test_the_pages_on_architecture_name_every_module() -> None:
    text = "".join(path.read_text() for path in (ROOT / "docs/architecture").glob("*.md"))
    modules = [path.stem for path in sources("urquhart", "server") if path.stem != "__init__"]
    missing = sorted({module for module in modules if not re.search(rf"\b{module}\b", text)})
    assert not missing


def test_the_pages_on_architecture_name_only_files_that_exist() -> None:
    text = "".join(path.read_text() for path in (ROOT / "docs/architecture").glob("*.md"))
    named = set(re.findall(r"`((?:urquhart|server|migrations|benchmarks)/[\w/.]+)`", text))
    assert len(named) > 10
    missing = {name for name in named if not any((ROOT / f"{name}{end}").exists() for end in ("", ".py"))}
    assert not missing
