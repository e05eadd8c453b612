"""Words: quaint ones, and those that stand for two things, stay out; docs/glossary.md has those that are meant."""

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = ("server", "urquhart", "clients", "tests", "benchmarks", "examples", "docs", "website")
PAGES = ("CONTRIBUTING.md", "Makefile")

INSTEAD = {
    "arrivals": "part of submaps",
    "sighting": "observation, query",
    "sightings": "observations, queries",
    "upkeep": "maintenance",
    "distrust": "quarantine",
    "doorkeeper": "authenticator",
    "sweep": "exhaustive search, correlation; of files: removal",
    "sweeps": "exhaustive search",
    "sweeping": "exhaustive search",
    "swept": "searched exhaustively, removed",
    "glance": "correlation",
    "climb": "hill_climb",
    "climbing": "hill climbing",
    "spool": "upload",
    "narrowing": "filters",
    "labour": "job_helpers",
    "killing": "kill_points",
    "house": "the name of what it is",
    "anew": "again, rebuilt",
    "lasting": "cumulative",
    "occupancy": "database lock",
    "renewal": "backfill",
    "bury": "fold",
    "doubt": "rival",
    "runnerup": "rival",
}
"""Words that are not used, in lower case, and what is said instead."""

ALLOWED = {
    # A curve over thresholds is a parameter sweep, in the field's words.
    "sweep": (
        *("benchmarks/paper/", "tests/benchmarks/test_paper.py"),
        *("server/schemas/candidates.py", "tests/server/queries/test_older_answers.py"),  # what older answers say
    ),
    "sweeps": (
        "benchmarks/paper/",
        "server/store/sqlite/upgrade/old_contents.py",
        "tests/server/store/test_upgrades.py",
        "tests/server/store/older.py",
    ),
    # What answers that older versions stored say.
    "runnerup": ("server/schemas/common.py", "tests/server/queries/test_older_answers.py"),
}
"""Where a word means something else than what it is refused for."""

SAME_IN_THE_CLIENT = (
    "urquhart/decide/",
    "urquhart/features/tessellation.py",
    "urquhart/report/",
    "urquhart/trace.py",
    "server/config/settings.py",
)
"""Where the other classes are whose contents the client reads as documents of the same name."""
CLIENT = "clients/python/urquhart_client"


def texts() -> Iterator[Path]:
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in (".py", ".md") and path != Path(__file__) and "node_modules" not in path.parts:
                yield path
    yield from (ROOT / page for page in PAGES)


def words_of(text: str) -> Iterator[tuple[int, str]]:
    """Words in lower case with their lines: prose, and the parts of identifiers. `hill_climb` and the like are one."""
    text = re.sub(r"(?i)hill.?climb", "hillclimb", text)
    text = re.sub(r"(?i)runner.?up", "runnerup", text)
    for number, line in enumerate(text.splitlines(), start=1):
        for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", line):
            yield number, word.lower()


def test_refused_words_are_not_used() -> None:
    found = []
    for path in texts():
        name = str(path.relative_to(ROOT))
        found += [
            f"{name}:{number}: {word!r}; say {INSTEAD[word]}"
            for number, word in words_of(path.read_text())
            if word in INSTEAD and not name.startswith(ALLOWED.get(word, ("-",)))
        ]
    assert not found, "\n".join(found)


def test_what_is_allowed_is_there() -> None:
    for word, places in ALLOWED.items():
        for place in places:
            paths = [ROOT / place] if place.endswith(".py") else list((ROOT / place).rglob("*.py"))
            assert any(word == one for path in paths for _, one in words_of(path.read_text())), (word, place)


@pytest.mark.parametrize("text", ["a_sighting", "SightingRow", "the sighting,", "SIGHTING", "runner-up", "runner_up"])
def test_a_refused_word_is_found_in_any_form(text: str) -> None:
    assert {word for _, word in words_of(text)} & INSTEAD.keys()


@pytest.mark.parametrize("text", ["hill_climb", "HillClimb", "the households", "in doubtful", "rehouse"])
def test_other_words_are_none(text: str) -> None:
    assert not {word for _, word in words_of(text)} & INSTEAD.keys()


def classes(*folders: str) -> dict[str, list[str]]:
    """Where classes of each name are defined."""
    found: dict[str, list[str]] = defaultdict(list)
    for folder in folders:
        for path in sorted((ROOT / folder).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.ClassDef):
                    found[node.name].append(str(path.relative_to(ROOT)))
    return found


def test_a_class_name_means_one_thing() -> None:
    """The client has the names of the documents that it reads: there, and only there, a name is defined again."""
    ours = classes("server", "urquhart", "migrations")
    assert not {name: where for name, where in ours.items() if len(where) > 1}
    tests = classes("tests")
    assert not {name: where for name, where in tests.items() if len(where) > 1}
    # Each benchmark stands alone, and may have a `Job` or a `Step` of its own, but none of the product's names.
    for others in (tests, classes("benchmarks")):
        assert not {name: [*ours[name], *others[name]] for name in ours.keys() & others.keys()}
    clients = classes(CLIENT)
    assert not {name: where for name, where in clients.items() if len(where) > 1}
    both = ours.keys() & clients.keys()
    assert not {
        name: ours[name] for name in both if not ours[name][0].startswith(("server/schemas/", *SAME_IN_THE_CLIENT))
    }
