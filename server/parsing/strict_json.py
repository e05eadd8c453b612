"""JSON from callers, limited in size and read exactly as written.

The parser silently keeps the last of several members with one name, and turns an integer beyond 64 bits into a float. A
compiled pass over the text finds both, with their position, without the GIL: 8 MB take about 15 ms.
"""

import os
from typing import Any, Final

import numpy as np
import orjson
from numpy.typing import NDArray

from server.errors import InvalidField, TooLarge
from server.parsing import large_json
from server.parsing.field_errors import pointer
from urquhart._kernel import kernel

_DEPTH: Final = 1_100
"""Deeper than the parser allows arrays and objects to be nested."""
_MEMBERS: Final = 5_000
_FEW_BYTES: Final = 1 << 16
_SECRET: Final = int.from_bytes(os.urandom(8), "little") >> 1
"""Secret of the hash, so that nobody can choose names with equal hashes."""
_SOUND, _INTEGER, _MEMBER = 0, 1, 2
_QUOTE, _ESCAPE, _COMMA, _COLON = (ord(sign) for sign in '"\\,:')
_OBJECT, _END_OBJECT, _ARRAY, _END_ARRAY = (ord(sign) for sign in "{}[]")
_MINUS, _PLUS, _DOT, _ZERO, _NINE, _SMALL_E, _LARGE_E, _SMALL_U = (ord(sign) for sign in "-+.09eEu")
_LARGEST, _SMALLEST = (np.frombuffer(str(limit).encode(), np.uint8) for limit in ((1 << 64) - 1, 1 << 63))


def read_json(raw: bytes, most: int) -> Any:
    """Parsed JSON within the limits of a request: at most `most` arrays and objects, none of them very wide.

    Raises TooLarge, orjson.JSONDecodeError, and InvalidField: also for a member that is in an object twice, and for an
    integer that does not fit into 64 bits.
    """
    _check_values(raw, most)
    content = large_json.parse(raw)
    _check_text(raw)
    _check_breadth(content, len(raw))
    return content


def warm_up() -> None:
    """Compile the kernels, so that no request waits for them."""
    _check_text(b'{"a": [1]}')
    large_json.warm_up()


def _check_text(raw: bytes) -> None:
    """Refuse well-formed JSON that the parser would not read as written. Raises InvalidField."""
    fault, depth, steps = _first_fault(np.frombuffer(raw, np.uint8), _SECRET, _LARGEST, _SMALLEST)
    if fault == _SOUND:
        return
    # The step of an object is the position of the member's name, that of an array the index in it.
    path = [orjson.loads(raw[a:b]) if b else int(a) for a, b in steps[:depth].tolist()]
    if fault == _MEMBER:
        raise InvalidField(
            "is in its object more than once; send each member once",
            code="duplicate_member",
            pointer=pointer(path),
        )
    raise InvalidField(
        "is an integer beyond 64 bits and would be rounded; send it as a string, or with a fraction or an exponent if "
        "it need not be exact",
        code="integer_range",
        pointer=pointer(path),
    )


@kernel
def _first_fault(
    text: NDArray[np.uint8], secret: int, largest: NDArray[np.uint8], smallest: NDArray[np.uint8]
) -> tuple[int, int, NDArray[np.int64]]:
    """The first fault in well-formed JSON, its depth, and the steps (depth, 2) that lead to it."""
    steps = np.empty((_DEPTH, 2), np.int64)
    objects = np.empty(_DEPTH, np.int64)  # the number of each open object, 0 for an array
    seen = np.zeros(256, np.uint64)
    depth = found = numbered = at = 0
    named = False  # whether the name of the next member has been read
    while at < len(text):
        sign = text[at]
        if sign == _QUOTE:
            begin, is_name = at, depth > 0 and objects[depth - 1] > 0 and not named
            mixed = _mix(np.uint64(secret) + np.uint64(objects[max(depth - 1, 0)]))
            at += 1
            while at < len(text) and text[at] != _QUOTE:
                if is_name:
                    code, at = _character(text, at)
                    mixed = _mix(mixed ^ np.uint64(code + 1))
                else:
                    at += 2 if text[at] == _ESCAPE else 1
            at += 1
            if is_name:
                named = True
                steps[depth - 1, 0], steps[depth - 1, 1] = begin, at
                if 2 * (found + 1) > len(seen):
                    seen = _grown(seen)
                if not _put(seen, mixed):
                    return _MEMBER, depth, steps
                found += 1
            continue
        if sign == _MINUS or _ZERO <= sign <= _NINE:
            begin, whole = at, True
            while at < len(text) and _in_number(text[at]):
                whole = whole and not (text[at] == _DOT or text[at] == _SMALL_E or text[at] == _LARGE_E)
                at += 1
            if whole and at - begin >= len(smallest):
                negative = text[begin] == _MINUS
                if _exceeds(text[begin + negative : at], smallest if negative else largest):
                    return _INTEGER, depth, steps
            continue
        if sign in (_OBJECT, _ARRAY):
            if depth == _DEPTH:
                return _SOUND, 0, steps  # deeper than the parser allows
            if sign == _OBJECT:
                numbered += 1
            objects[depth] = numbered if sign == _OBJECT else 0
            steps[depth, 0], steps[depth, 1], named = 0, 0, False
            depth += 1
        elif sign in (_END_OBJECT, _END_ARRAY):
            depth = max(depth - 1, 0)
            named = True
        elif sign == _COMMA and depth > 0:
            named = False
            if objects[depth - 1] == 0:
                steps[depth - 1, 0] += 1
        at += 1
    return _SOUND, 0, steps


@kernel
def _character(text: NDArray[np.uint8], at: int) -> tuple[int, int]:
    """The character at a position in a string, in UTF-8 or escaped, and the position of the next one."""
    first = int(text[at])
    if first != _ESCAPE:
        more = 0 if first < 0xC0 else (1 if first < 0xE0 else (2 if first < 0xF0 else 3))
        code = first if more == 0 else first & (0x3F >> more)
        for k in range(1, min(more + 1, len(text) - at)):
            code = (code << 6) | (int(text[at + k]) & 0x3F)
        return code, at + more + 1
    escape = int(text[min(at + 1, len(text) - 1)])
    if escape != _SMALL_U:
        return _short_escape(escape), at + 2
    code = _hex(text, at + 2)
    if 0xD800 <= code < 0xDC00:  # the first half of a surrogate pair; the other half follows
        return 0x10000 + ((code - 0xD800) << 10) + (_hex(text, at + 8) - 0xDC00), at + 12
    return code, at + 6


@kernel
def _short_escape(sign: int) -> int:
    """The character that a backslash and a letter stand for."""
    for letter, code in ((98, 8), (102, 12), (110, 10), (114, 13), (116, 9)):  # b f n r t
        if sign == letter:
            return code
    return sign


@kernel
def _hex(text: NDArray[np.uint8], at: int) -> int:
    """The number of four hexadecimal digits."""
    number = 0
    for k in range(at, min(at + 4, len(text))):
        digit = int(text[k])
        number = 16 * number + (digit - 48 if digit < 65 else (digit | 32) - 87)
    return number


@kernel
def _in_number(sign: int) -> bool:
    """Whether a character may be part of a number."""
    return bool(_ZERO <= sign <= _NINE or sign in (_MINUS, _PLUS, _DOT, _SMALL_E, _LARGE_E))


@kernel
def _exceeds(digits: NDArray[np.uint8], limit: NDArray[np.uint8]) -> bool:
    """Whether a number without leading zeros is larger than another."""
    if len(digits) != len(limit):
        return len(digits) > len(limit)
    for k in range(len(digits)):
        if digits[k] != limit[k]:
            return bool(digits[k] > limit[k])
    return False


@kernel
def _mix(number: np.uint64) -> np.uint64:
    """A hash of a number (the finalizer of MurmurHash3)."""
    number ^= number >> np.uint64(33)
    number *= np.uint64(0xFF51AFD7ED558CCD)
    number ^= number >> np.uint64(33)
    number *= np.uint64(0xC4CEB9FE1A85EC53)
    return number ^ (number >> np.uint64(33))


@kernel
def _put(seen: NDArray[np.uint64], mixed: np.uint64) -> bool:
    """Put a hash into a table whose length is a power of two, with 0 for free places. False if it is there already.

    Names are compared by 64 bits: of a million members, two are confused once in 4 * 10^7 times.
    """
    mixed = max(mixed, np.uint64(1))
    last = np.uint64(len(seen) - 1)
    place = mixed & last
    while seen[place] != np.uint64(0):
        if seen[place] == mixed:
            return False
        place = (place + np.uint64(1)) & last
    seen[place] = mixed
    return True


@kernel
def _grown(seen: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """The same table with four times the size."""
    larger = np.zeros(4 * len(seen), np.uint64)
    for mixed in seen:
        if mixed != np.uint64(0):
            _put(larger, mixed)
    return larger


def _check_values(raw: bytes, most: int) -> None:
    """Refuse JSON with very many arrays and objects before parsing, because nobody is answered while Python creates
    them.

    Brackets in texts count, too: no request has so many of them. Raises TooLarge.
    """
    got = raw.count(b"[") + raw.count(b"{")
    if got > most:
        raise TooLarge("body_values", most, got, "Send fewer submaps or queries at a time.")


def _check_breadth(content: Any, size: int) -> None:
    """Refuse JSON of `size` bytes in which an object has very many members, instead of reporting each.

    No request has so many, and hundreds of thousands of errors take seconds, during which nobody else is answered.
    `properties` is the caller's own, and has its own limit. Raises InvalidField.
    """
    level: list[Any] = [content] if size > _FEW_BYTES else []
    while level:
        wide = next((outer for outer in level if isinstance(outer, dict) and len(outer) > _MEMBERS), None)
        if wide is not None:
            raise InvalidField(
                f"has an object of {len(wide)} members; at most {_MEMBERS} are allowed",
                code="too_many_members",
                pointer="",
            )
        inner: list[Any] = []
        for outer in level:
            if isinstance(outer, dict):
                inner += [v for k, v in outer.items() if isinstance(v, dict | list) and k != "properties"]
            elif isinstance(outer, list):  # points are lists of numbers, which need no check
                inner += [value for value in outer if isinstance(value, dict)]
        level = inner
