"""The log of a process: one line for each event, as text for people or as JSON for programs.

No caller can forge a line: unprintable characters are escaped, and the lines of a traceback are indented. Nor can a
caller forge a field: an ambiguous value in a line of text is quoted as JSON.
"""

import json
import logging
import re
import sys
from collections.abc import Mapping
from datetime import UTC, datetime
from functools import lru_cache
from typing import Any, Final, TextIO

import orjson

from server.config.settings_groups import LogSettings

ACCESS: Final = "access"
_LEVELS: Final = {"debug": logging.DEBUG, "info": logging.INFO, "warning": logging.WARNING, "error": logging.ERROR}
_LONGEST: Final = 200
"""Characters of a path that are logged."""
_PLAIN: Final = re.compile(r"[A-Za-z0-9!#$%&'()*+,./:;<>?@\[\]^_`{|}~-]+")
"""A value that needs no quotes in a line of text: ASCII without space, `=`, quote and backslash."""
_access = logging.getLogger(ACCESS)


def configure(settings: LogSettings, stream: TextIO | None = None) -> None:
    """Send all log records of this process to `stream`, standard error by default, in one format.

    The web server's own loggers use it, too. Its access log is replaced by ours.
    """
    # What no line shows is not looked up for each of them.
    logging.logThreads = logging.logProcesses = logging.logMultiprocessing = False
    handler = logging.StreamHandler(stream or sys.stderr)
    handler.setFormatter(JsonLines() if settings.format == "json" else TextLines())
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(_LEVELS[settings.level])
    for name in ("uvicorn", "uvicorn.error", "uvicorn.asgi"):
        logger = logging.getLogger(name)
        logger.handlers.clear()
        logger.propagate = True
        logger.setLevel(logging.NOTSET)
    silent = logging.getLogger("uvicorn.access")
    silent.handlers.clear()
    silent.propagate = False
    # Details of libraries are not for operators.
    for name in ("numba", "alembic", "asyncio", "httpx", "httpcore"):
        logging.getLogger(name).setLevel(max(logging.WARNING, _LEVELS[settings.level]))


def log_access(fields: Mapping[str, Any]) -> None:
    """Log one request. `fields` has at least method, path, status and ms."""
    level = logging.WARNING if fields["status"] >= 500 else logging.INFO
    if _access.isEnabledFor(level):
        # Not `info()`, which would search the stack for its caller.
        record = logging.LogRecord(ACCESS, level, "", 0, "request", None, None)
        record.fields = fields
        _access.handle(record)


def shortened(path: str) -> str:
    """A path, shortened to what a log line should contain."""
    return path if len(path) <= _LONGEST else f"{path[:_LONGEST]}..."


def quoted(value: object) -> str:
    """A value in a line of text, whose fields are separated by spaces: unchanged if unambiguous, else as a JSON string.

    A JSON string ends at the first `"` without a backslash before it. So `path="/a b key=x"` is one field.
    """
    text = str(value)
    if _PLAIN.fullmatch(text):
        return text
    return json.dumps(text, ensure_ascii=not text.isprintable())


def escaped(text: str) -> str:
    """The text on one line, with line ends, control and other unprintable characters escaped."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape", "backslashreplace").decode() for c in text)


class JsonLines(logging.Formatter):
    """A JSON object on each line: time, level, logger, message, and for requests the fields of the request."""

    def format(self, record: logging.LogRecord) -> str:
        """The line, without a line end."""
        line: dict[str, Any] = {"time": _time(record), "level": record.levelname.lower(), "logger": record.name}
        fields = getattr(record, "fields", None)
        if fields is None:
            line["message"] = record.getMessage()
        else:
            line |= fields
        if record.exc_info:
            line["exception"] = self.formatException(record.exc_info)
        try:
            text = orjson.dumps(line, default=str).decode()
        except orjson.JSONEncodeError:  # lone surrogates, which only Python has
            return json.dumps(line, default=str)
        # JSON allows separators that some readers of logs take for line ends.
        return text if text.isprintable() else json.dumps(line, default=str)


class TextLines(logging.Formatter):
    """A line for people. The lines of a traceback follow it, indented."""

    def format(self, record: logging.LogRecord) -> str:
        """The line, without a line end."""
        head = f"{_time(record)} {record.levelname:<7} {record.name}: "
        fields = getattr(record, "fields", None)
        line = head + (escaped(record.getMessage()) if fields is None else _request(fields))
        if record.exc_info:
            trace = self.formatException(record.exc_info).splitlines()
            line += "".join(f"\n    {escaped(part)}" for part in trace)
        return line


def _request(fields: Mapping[str, Any]) -> str:
    """The event first, then the other fields as name=value."""
    first = f"{quoted(fields['method'])} {quoted(fields['path'])} {fields['status']} {fields['ms']} ms"
    rest = [
        f"{name}={_shown(name, value)}"
        for name, value in fields.items()
        if name not in _FIRST and value not in (None, "", 0)
    ]
    return " ".join([first, *rest])


def _shown(name: str, value: Any) -> str:
    if isinstance(value, dict):
        return orjson.dumps(value).decode()
    if isinstance(value, int | float):
        return str(value)
    return _quoted_often(value) if name in _OFTEN else quoted(value)


_FIRST: Final = frozenset({"method", "path", "status", "ms"})
_OFTEN: Final = frozenset({"route", "address", "key", "collection", "verdict"})
"""Fields with the same few values in most requests."""
_quoted_often = lru_cache(maxsize=256)(quoted)


def _time(record: logging.LogRecord) -> str:
    return f"{_second(int(record.created))}.{int(record.msecs):03d}Z"


@lru_cache(maxsize=1)
def _second(since_1970: int) -> str:
    return f"{datetime.fromtimestamp(since_1970, UTC):%Y-%m-%dT%H:%M:%S}"
