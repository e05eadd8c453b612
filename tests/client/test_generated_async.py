"""The awaiting client is the blocking one, awaited."""

import ast
import importlib.util
import inspect
from pathlib import Path

from urquhart_client import AsyncClient, Client

GENERATOR = Path(__file__).parents[2] / "clients/python/generate_async.py"


def test_it_is_made_of_the_blocking_one() -> None:
    spec = importlib.util.spec_from_file_location("generate_async", GENERATOR)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    made = module.generated()
    assert made
    for path, text in made.items():
        # Imports are sorted by what they are called, and lines are cut where they are too long.
        assert _told(path.read_text()) == _told(text), "python clients/python/generate_async.py"


def _told(source: str) -> list[str]:
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            node.names.sort(key=lambda name: name.name)
    return sorted(ast.dump(node) for node in tree.body)


def test_both_have_the_same_calls() -> None:
    def calls(kind: type) -> dict[str, list[str]]:
        return {
            name: list(inspect.signature(call).parameters)
            for name, call in inspect.getmembers(kind, inspect.isfunction)
            if not name.startswith("_")
        }

    assert calls(Client) == calls(AsyncClient)
    for name, call in inspect.getmembers(AsyncClient, inspect.isfunction):
        if not name.startswith("_"):
            listing = "Iterator" in str(inspect.signature(call).return_annotation)
            assert inspect.iscoroutinefunction(call) != listing, name
            assert inspect.getdoc(call), name
