"""The error of a command that cannot do what it was asked to do."""


class CommandError(Exception):
    """Ends the command with `str(error)` as its one line on standard error, and exit code 2."""
