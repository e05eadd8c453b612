"""The command `urquhart`.

Anything wrong with the input, from a missing file to a database of a newer version, ends as one line on standard error
and exit code 2. A defect of the program ends as a traceback, so that it can be reported.
"""

import sys
from collections.abc import Sequence
from typing import Annotated, Final

import typer
from pydantic import ValidationError
from typer.exceptions import TyperException

from server.commands import config, db, index, jobs, keys, locate, reference, serve, snapshot
from server.commands.demo import command as demo
from server.commands.support.failure import CommandError
from server.config.file_and_environment import Misconfigured
from server.errors import DomainError
from server.parsing.field_errors import sentence
from server.platform.version import service_version
from server.stem_maps.reader import StemMapError
from urquhart import ConfigError, LandmarkError

EXIT_BAD_INPUT: Final = 2
EXIT_INTERRUPTED: Final = 130

app = typer.Typer(
    name="urquhart",
    help="A place-recognition database for forests: tree positions in, a verified pose out.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
)


def _examples(*lines: str) -> str:
    """The end of a command's help, as Markdown."""
    return "Examples:\n\n" + "\n".join(f"- `{line}`" for line in lines)


app.command(
    epilog=_examples(
        "urquhart serve", "urquhart serve --host 0.0.0.0 --workers 2 --database /var/lib/urquhart/forest.db"
    )
)(serve.serve)
app.command(epilog=_examples("urquhart index plots/*.csv --collection season-2026 --radius 30 --spacing 20"))(
    index.index
)
app.command(
    epilog=_examples(
        "urquhart locate seen.csv --collection season-2026",
        "urquhart locate seen.csv --collection season-2026 --svg match.svg --explain",
    )
)(locate.locate)
app.command(epilog=_examples("urquhart demo --seed 5", "urquhart demo --keep"))(demo.demo)
app.command("reference", epilog=_examples("urquhart reference > docs/api.md"))(reference.reference_page)
app.command(epilog=_examples("urquhart config", "urquhart config --config /etc/urquhart.toml"))(config.config)
app.add_typer(db.app, name="db")
app.add_typer(keys.app, name="keys")
app.add_typer(jobs.app, name="jobs")
app.add_typer(snapshot.app, name="snapshot")


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"urquhart {service_version()}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def root(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """A place-recognition database for forests: tree positions in, a verified pose out."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def run(arguments: Sequence[str] | None = None) -> int:
    """Run one command; its exit code. `arguments` are without the program's name, default those of the process."""
    try:
        code = app(args=arguments, prog_name="urquhart", standalone_mode=False)
    except TyperException as error:
        return _refuse(_usage(error))
    except (CommandError, Misconfigured, DomainError, StemMapError, ConfigError, LandmarkError) as error:
        return _refuse(str(error))
    except OSError as error:
        if error.filename is None:
            raise
        return _refuse(f"{error.filename}: {error.strerror}")
    except (typer.Abort, KeyboardInterrupt):
        return EXIT_INTERRUPTED
    return code if isinstance(code, int) else 0


def main() -> None:
    """Entry point of the console script."""
    sys.exit(run())


def _usage(error: TyperException) -> str:
    """What is wrong with a command line, and which help to read."""
    context, cause = getattr(error, "ctx", None), error.__cause__
    message = error.format_message()
    if isinstance(cause, ValidationError):
        first = cause.errors()[0]
        about, _, _ = message.partition(": ")  # what follows are words of the library
        names_value = first["type"] == "value_error"
        message = f"{about}: {'' if names_value else repr(first['input']) + ' '}{sentence(first)}"
    return f"{message.removesuffix('.')} (see {context.command_path if context else 'urquhart'} --help)"


def _refuse(message: str) -> int:
    line = " ".join(message.split())
    typer.echo(f"urquhart: {line}", err=True)
    return EXIT_BAD_INPUT


if __name__ == "__main__":
    main()
