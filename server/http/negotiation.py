"""Content negotiation: the choice among the media types that a route offers."""

from collections.abc import Sequence

from server.errors import NotAcceptable

JSON = "application/json"
GEOJSON = "application/geo+json"
CSV = "text/csv"
SVG = "image/svg+xml"
NDJSON = "application/x-ndjson"
HTML = "text/html"
SQLITE = "application/vnd.sqlite3"


def choose(accept: str | None, offered: Sequence[str]) -> str:
    """The offered type that Accept prefers, the first offered among equals. Raises NotAcceptable."""
    if accept is None or not accept.strip():
        return offered[0]
    ranges = [_read(part) for part in accept.split(",")]
    best, best_quality = None, 0.0
    for media_type in offered:
        quality = _quality(media_type, ranges)
        if quality > best_quality:
            best, best_quality = media_type, quality
    if best is None:
        shown = accept if len(accept) <= 100 else f"{accept[:100]}..."
        raise NotAcceptable(
            f"None of the media types in Accept ({shown}) can be produced here. Ask for one of {', '.join(offered)}.",
            offered,
        )
    return best


def _quality(media_type: str, ranges: Sequence[tuple[str, float]]) -> float:
    """The quality given by the most specific range that covers the type, as in RFC 9110."""
    major = media_type.split("/")[0]
    for wanted in (media_type, f"{major}/*", "*/*"):
        for name, quality in ranges:
            if name == wanted:
                return quality
    return 0.0


def _read(part: str) -> tuple[str, float]:
    name, *parameters = (piece.strip() for piece in part.lower().split(";"))
    for parameter in parameters:
        if parameter.startswith("q="):
            try:
                return name, min(max(float(parameter[2:]), 0.0), 1.0)
            except ValueError:
                return name, 0.0
    return name, 1.0


def accepts_coding(header: str | None, coding: str) -> bool:
    """Whether Accept-Encoding allows a coding, by name or by *, and does not prefer the uncompressed answer.

    The uncompressed answer comes last if it is not named.
    """
    found = {name.removeprefix("x-"): quality for name, quality in map(_read, (header or "").split(","))}
    quality = found.get(coding, found.get("*", 0.0))
    return quality > 0.0 and quality >= found.get("identity", 0.0)
