"""Which commands there are, without loading what they work with.

Importing the service takes more than a second; `urquhart --version` and `--help` need none of it. So the command line
knows only names, first sentences and examples. A command is imported when it is run or its own help is asked for.
"""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from typing import Any, Final

import typer
from typer.core import TyperCommand, TyperGroup


@contextmanager
def _no_collection() -> Iterator[None]:
    """Collect no garbage within the block. Importing makes objects that stay, and looking through them again and again
    takes a fifth of the time of loading the service.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


@dataclass(frozen=True, slots=True)
class CommandEntry:
    """A command: where it is, its first sentence, and lines for the end of its help.

    `attribute` of `module` is a function, or a `typer.Typer` with commands of its own.
    """

    module: str
    attribute: str
    summary: str
    examples: tuple[str, ...] = ()

    def load(self, name: str) -> Any:
        """Import the command and build it, under the given name."""
        with _no_collection():
            found: typer.Typer | Callable[..., None] = getattr(import_module(self.module), self.attribute)
        if isinstance(found, typer.Typer):
            group = typer.main.get_group(found)
            group.name = name
            return group
        alone = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode="markdown")
        alone.command(name, epilog=self.epilog())(found)
        return typer.main.get_command(alone)

    def epilog(self) -> str | None:
        """The end of the command's help, as Markdown."""
        return "Examples:\n\n" + "\n".join(f"- `{line}`" for line in self.examples) if self.examples else None


COMMANDS: Final = {
    "serve": CommandEntry(
        "server.commands.serve",
        "serve",
        "Serve the REST API.",
        ("urquhart serve", "urquhart serve --host 0.0.0.0 --workers 2 --database /var/lib/urquhart/forest.db"),
    ),
    "check": CommandEntry(
        "server.commands.check",
        "check",
        "Show how a file is understood, and what is in it. Nothing is stored.",
        ("urquhart check season.xlsx --svg season.svg", "urquhart check plots.csv --plot plot --unit ft"),
    ),
    "index": CommandEntry(
        "server.commands.index",
        "index",
        "Cut stem maps into overlapping submaps and store them.",
        (
            "urquhart index plots/*.csv --collection season-2026 --radius 30 --spacing 20",
            "urquhart index season.csv --plot plot --one-submap --collection season-2026",
        ),
    ),
    "coregister": CommandEntry(
        "server.commands.coregister",
        "coregister",
        "Place all plots of a season in a map, and report where each one is.",
        (
            "urquhart coregister plots.xlsx --collection als --out season-2026",
            "urquhart coregister plots/ --collection als --out season-2026 --crs EPSG:25832",
        ),
    ),
    "locate": CommandEntry(
        "server.commands.locate",
        "locate",
        "Find where trees were observed, in the whole collection or, with --at, near a place.",
        (
            "urquhart locate seen.csv --collection season-2026",
            "urquhart locate seen.csv --collection season-2026 --svg match.svg --explain",
        ),
    ),
    "export": CommandEntry(
        "server.commands.export",
        "export",
        "Write landmarks, submaps, matches or pairs as CSV, GeoJSON, GeoPackage or GeoParquet.",
        (
            "urquhart export landmarks trees.gpkg --collection season-2026",
            "urquhart export matches placed.csv --collection season-2026 --frame als",
        ),
    ),
    "map": CommandEntry("server.commands.map", "app", "Build one consistent map of the submaps of a collection."),
    "demo": CommandEntry(
        "server.commands.demo.command",
        "demo",
        "Recognise places in real forests, over HTTP.",
        ("urquhart demo --seed 5", "urquhart demo --keep"),
    ),
    "reference": CommandEntry(
        "server.commands.reference",
        "reference_page",
        "Print the API reference as Markdown.",
        ("urquhart reference > docs/api.md",),
    ),
    "config": CommandEntry(
        "server.commands.config",
        "config",
        "Print every setting with its value, its default and the source of the value.",
        ("urquhart config", "urquhart config --config /etc/urquhart.toml"),
    ),
    "warm": CommandEntry(
        "server.commands.warm",
        "warm",
        "Compile the kernels, or load them from the cache, so that no start has to wait for it.",
        ("urquhart warm", "NUMBA_CACHE_DIR=/opt/urquhart/kernels NUMBA_CPU_NAME=generic urquhart warm"),
    ),
    "db": CommandEntry(
        "server.commands.operator.db", "app", "Upgrade and check the database file, and rebuild its index."
    ),
    "stands": CommandEntry(
        "server.commands.operator.stands",
        "app",
        "List and show what stem maps were stored in a collection; replace, move and remove it.",
    ),
    "keys": CommandEntry("server.commands.operator.keys", "app", "Create, list and revoke API keys."),
    "jobs": CommandEntry("server.commands.operator.jobs", "app", "List the jobs of a database, and cancel them."),
    "snapshot": CommandEntry(
        "server.commands.snapshot",
        "app",
        "Create, list, verify, delete and restore snapshots of the whole database.",
    ),
}
"""All commands, in the order of the help. A test compares the sentences with those of the commands themselves."""


class Unloaded(TyperCommand):
    """A command that is imported when its arguments are parsed."""

    def __init__(self, name: str, entry: CommandEntry) -> None:
        """Know the command by its entry."""
        super().__init__(name, help=entry.summary, rich_markup_mode="markdown")
        self._entry = entry

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        """The context of the command itself."""
        command = self._entry.load(self.name or "")
        return command.make_context(info_name, args, parent=parent, **extra)


class LazyCommands(TyperGroup):
    """A group of the commands of `COMMANDS`."""

    def __init__(self, **attributes: Any) -> None:
        """Add the commands, none of which is loaded."""
        super().__init__(**attributes)
        for name, entry in COMMANDS.items():
            self.add_command(Unloaded(name, entry))
