"""The command `urquhart`.

Anything wrong with the input, from a missing file to a database of a newer version, ends as one line on standard error
and exit code 2. A defect of the program ends as a traceback, so that it can be reported.
"""

import sys
from collections.abc import Sequence
from typing import Annotated, Final

import typer
from typer.exceptions import TyperException

from server.commands.loading import LazyCommands
from server.platform.version import service_version

EXIT_BAD_INPUT: Final = 2
EXIT_INTERRUPTED: Final = 130
_REFUSALS: Final = (
    ("server.commands.support.failure", "CommandError"),
    ("server.config.file_and_environment", "Misconfigured"),
    ("server.errors", "DomainError"),
    ("server.stem_maps.formats.table", "StemMapError"),
    ("urquhart.config", "ConfigError"),
    ("urquhart.features.landmark_checks", "LandmarkError"),
)

app = typer.Typer(
    name="urquhart",
    cls=LazyCommands,
    help="A place-recognition database for forests: tree positions in, a verified pose out.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
)


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
    except (typer.Abort, KeyboardInterrupt):
        return EXIT_INTERRUPTED
    except TyperException as error:
        return _refuse(_usage(error))
    except _refusals() as error:
        return _refuse(_named(error, sys.argv[1:] if arguments is None else arguments))
    except OSError as error:
        if error.filename is None:
            raise
        return _refuse(f"{error.filename}: {error.strerror}")
    return code if isinstance(code, int) else 0


def main() -> None:
    """Entry point of the console script."""
    sys.exit(run())


def _refusals() -> tuple[type[Exception], ...]:
    """The errors that say what is wrong with the input: only those whose modules are loaded can have been raised."""
    return tuple(getattr(sys.modules[module], name) for module, name in _REFUSALS if module in sys.modules)


def _named(error: Exception, arguments: Sequence[str]) -> str:
    """What is wrong, after the option that it is about, if a value of the request names one that was given."""
    pointer = getattr(error, "pointer", None) or ""
    member = getattr(error, "parameter", None) or pointer.lstrip("/").partition("/")[0]
    option = "--" + member.replace("_", "-")
    given = {word.partition("=")[0] for word in arguments if word.startswith("--")}
    found = next((one for one in (option, option.removesuffix("s")) if one in given), None)
    return str(error) if found is None else f"{found}: {error}"


def _usage(error: TyperException) -> str:
    """What is wrong with a command line, and which help to read."""
    context, cause = getattr(error, "ctx", None), error.__cause__
    message = error.format_message()
    if cause is not None:
        from pydantic import ValidationError

        from server.parsing.field_errors import sentence

    if cause is not None and isinstance(cause, ValidationError):
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
