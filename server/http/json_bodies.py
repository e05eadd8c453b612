"""JSON bodies: how they must be sent, and what is told of those that are not JSON."""

import orjson

from server.errors import UnsupportedMediaType


def check_content_type(content_type: str | None) -> None:
    """Raise UnsupportedMediaType for a body that is not sent as JSON in UTF-8."""
    name, *parameters = (part.strip().lower() for part in (content_type or "").split(";"))
    if name != "application/json":
        shown = "nothing" if not name else name[:100]
        raise UnsupportedMediaType(f"Content-Type says {shown}; send JSON with Content-Type: application/json.")
    for parameter in parameters:
        if parameter.startswith("charset=") and parameter[8:].strip('"') not in {"utf-8", "utf8"}:
            raise UnsupportedMediaType("JSON is sent in UTF-8; leave the charset out.")


def malformed_detail(error: orjson.JSONDecodeError, body: bytes) -> str:
    """What is wrong with a body that is not JSON, in a sentence."""
    where = f"line {error.lineno}, column {error.colno}"
    around = body[max(error.pos - 1, 0) : error.pos + 9].lstrip(b"-").lower()
    if around.startswith((b"nan", b"inf")) or b"nan" in around or b"infinity" in around:
        return f"JSON has no NaN or Infinity ({where}); leave such landmarks out."
    return f"The body is not JSON: {error.msg.split(': line')[0]} ({where})."
