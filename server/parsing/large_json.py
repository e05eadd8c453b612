"""Large JSON parsed in pieces, because the parser does not release the interpreter while it reads."""

from typing import Any, Final

import numpy as np
import orjson
from numpy.typing import NDArray

from server.platform.precedence import give_way
from urquhart._kernel import kernel

_FEW_BYTES: Final = 1 << 16
"""A text up to this size is parsed as a whole."""
_PIECE: Final = 1 << 15
"""Bytes that the parser reads in half a millisecond, in which nobody else has the interpreter."""
_NO_PIECES: Final = np.empty((0, 3), np.int64)
_QUOTE, _ESCAPE, _COMMA = (ord(sign) for sign in '"\\,')
_OBJECT, _END_OBJECT, _ARRAY, _END_ARRAY = (ord(sign) for sign in "{}[]")


def warm_up() -> None:
    """Load what is compiled, so that no request waits for it."""
    _pieces(np.frombuffer(b'{"a": [1]}', np.uint8), 1)


def parse(raw: bytes) -> Any:
    """Parse JSON; the long arrays of a large object in pieces, because the parser never lets go of the interpreter.

    Raises orjson.JSONDecodeError.
    """
    members, pieces = _pieces(np.frombuffer(raw, np.uint8), _PIECE) if len(raw) > _FEW_BYTES else (0, _NO_PIECES)
    if not len(pieces):
        return orjson.loads(raw)
    spans = [tuple(row) for row in pieces.tolist()]
    try:
        content = orjson.loads(_without(raw, spans))
        names = list(content)
        if len(names) == members:  # otherwise one of them comes twice
            for member, begin, end in spans:
                give_way()
                piece = raw[begin:end]
                if not piece.strip():
                    break
                content[names[member]] += orjson.loads(b"[" + piece + b"]")
            else:
                return content
    except orjson.JSONDecodeError:
        pass  # the whole says where the mistake stands
    return orjson.loads(raw)


def _without(raw: bytes, spans: list[tuple[int, int, int]]) -> bytes:
    """JSON whose long arrays are empty."""
    kept, at = [], 0
    for _, begin, end in spans:
        if raw[begin - 1 : begin] == b"[":  # the first piece of an array
            kept.append(raw[at:begin])
        at = end
    return b"".join((*kept, raw[at:]))


@kernel
def _pieces(text: NDArray[np.uint8], size: int) -> tuple[int, NDArray[np.int64]]:
    """How many members the outermost object has, and the pieces of its long arrays, cut between elements.

    Each piece is the number of its member and where it begins and ends, (pieces, 3) int64, of `size` bytes or more but
    for the last one of an array. There are none where the text is no object, or is not well-formed as far as brackets
    and quotes tell; what lies between them is not looked at.
    """
    pieces = np.empty((2 * (len(text) // size) + 2, 3), np.int64)
    count = depth = member = at = begin = first = 0
    in_array = False
    while at < len(text):
        sign = text[at]
        if sign == _QUOTE:
            at += 1
            while at < len(text) and text[at] != _QUOTE:
                at += 2 if text[at] == _ESCAPE else 1
        elif sign in (_OBJECT, _ARRAY):
            if depth == 0 and sign == _ARRAY:
                return 0, pieces[:0]
            if depth == 1 and sign == _ARRAY:
                in_array, begin, first = True, at + 1, count
            depth += 1
        elif sign in (_END_OBJECT, _END_ARRAY):
            depth -= 1
            if depth < 0 or (depth == 1 and in_array and sign != _END_ARRAY):
                return 0, pieces[:0]
            if depth == 1 and in_array:
                if count > first:
                    pieces[count, 0], pieces[count, 1], pieces[count, 2] = member, begin, at
                    count += 1
                in_array = False
        elif sign == _COMMA and depth == 1:
            member += 1
        elif sign == _COMMA and depth == 2 and in_array and at - begin >= size:
            pieces[count, 0], pieces[count, 1], pieces[count, 2] = member, begin, at
            count += 1
            begin = at + 1
        at += 1
    return member + 1, pieces[: count if depth == 0 else 0]
