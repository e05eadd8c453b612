"""JSON of callers: what a parser would change without a word is refused, and told where it stands."""

import gzip
import json
from collections.abc import Callable
from typing import Any

import httpx
import orjson
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from server.errors import InvalidField
from server.parsing.field_errors import pointer
from server.parsing.strict_json import read_json
from tests.server.factories import forest, points
from tests.server.jobs.test_jobs import finished, results, upload

XY = json.dumps(points(forest(1)))
BEYOND = [2**64, -(2**63) - 1, 10**30]
WITHIN = [2**64 - 1, -(2**63), 2**53 + 1, 0]
MOST = 10_000


class Members(list[tuple[str, Any]]):
    """An object with all its members, those that come twice among them."""


def first_fault(content: Any, path: tuple[str | int, ...] = ()) -> tuple[str, str] | None:
    """What is wrong with a document, by another way: code and pointer, the first in the order of the text."""
    if isinstance(content, Members):
        seen = set[str]()
        for name, value in content:
            if name in seen:
                return "duplicate_member", pointer([*path, name])
            seen.add(name)
            if (found := first_fault(value, (*path, name))) is not None:
                return found
    elif isinstance(content, list):
        for position, value in enumerate(content):
            if (found := first_fault(value, (*path, position))) is not None:
                return found
    elif isinstance(content, int) and not -(2**63) <= content < 2**64:
        return "integer_range", pointer(path)
    return None


names = st.sampled_from(["a", "b", "", "é", "\U0001f600", 'a"', "a\\", "a/b", "\n", "{", "[,:", "x" * 40]) | st.text()
leaves = (
    st.none()
    | st.booleans()
    | st.floats(allow_nan=False, allow_infinity=False)
    | names
    | st.integers(-(2**65), 2**65)
    | st.sampled_from([*BEYOND, *WITHIN])
)
documents = st.recursive(
    leaves,
    lambda inner: st.lists(inner, max_size=5) | st.lists(st.tuples(names, inner), max_size=6).map(Members),
    max_leaves=30,
)


def written(content: Any, data: st.DataObject) -> str:
    """A document as text, its names and strings in escapes or as they are, and with spaces anywhere."""
    space = data.draw(st.sampled_from(["", "", " ", "\n\t"]))
    if isinstance(content, Members):
        inner = [f"{written(name, data)}{space}:{written(value, data)}" for name, value in content]
        return f"{{{space}{','.join(inner)}}}"
    if isinstance(content, list):
        return f"[{','.join(written(one, data) for one in content)}{space}]"
    if isinstance(content, str):
        return json.dumps(content, ensure_ascii=data.draw(st.booleans()))
    return json.dumps(content)


@given(documents, st.data())
@settings(max_examples=200, deadline=None)
def test_the_first_fault_is_told_and_nothing_else_is_refused(content: Any, data: st.DataObject) -> None:
    text = written(content, data)
    try:
        raw = text.encode()
    except UnicodeEncodeError:
        return  # half a character, which is no UTF-8
    try:
        expected = orjson.loads(raw)
    except orjson.JSONDecodeError:
        return
    fault = first_fault(json.loads(text, object_pairs_hook=Members))
    if fault is None:
        assert read_json(raw, MOST) == expected
        return
    with pytest.raises(InvalidField) as caught:
        read_json(raw, MOST)
    assert (caught.value.code, caught.value.pointer) == fault


def test_many_members_are_told_apart() -> None:
    members = {f"m{i}": {"a": i, "b": [i]} for i in range(4_000)}
    assert read_json(orjson.dumps({"properties": members}), 100_000) == {"properties": members}
    doubled = orjson.dumps(members)[:-1] + b',"m3999":1}'
    with pytest.raises(InvalidField) as caught:
        read_json(doubled, 100_000)
    assert caught.value.pointer == "/m3999"


@pytest.mark.parametrize("depth", [990, 1_020, 1_023])
def test_what_is_deep_is_read_or_malformed(depth: int) -> None:
    assert read_json(b"[" * depth + b"1" + b"]" * depth, MOST)
    with pytest.raises(InvalidField) as caught:
        read_json(b"[" * depth + b'{"a":1,"a":2}' + b"]" * depth, MOST)
    assert caught.value.pointer == "/0" * depth + "/a"
    with pytest.raises(orjson.JSONDecodeError):
        read_json(b"[" * 2_000 + b"]" * 2_000, MOST)


BODIES = [
    ("PUT", "/v1/collections/new", '{{"title": "t", "config": {{"gate": 0.9}}, {0}}}', "/title"),
    ("PATCH", "/v1/collections/plots", '{{"title": "t", {0}}}', "/title"),
    ("PUT", "/v1/collections/plots/submaps/p", '{{"title": 1, "xy": ' + XY + ", {0}}}", "/title"),
    ("PATCH", "/v1/collections/plots/submaps/p", '{{"title": "t", {0}}}', "/title"),
    ("POST", "/v1/collections/plots/queries", '{{"title": 1, "xy": ' + XY + ", {0}}}", "/title"),
    ("POST", "/v1/collections/plots/constraints", '{{"title": 1, {0}}}', "/title"),
]


@pytest.mark.parametrize(("method", "path", "body", "where"), BODIES)
@pytest.mark.parametrize("packed", [False, True])
def test_members_that_come_twice_are_refused_everywhere(
    shared_client: httpx.Client, method: str, path: str, body: str, where: str, packed: bool
) -> None:
    content = body.format('"title": "other"').encode()
    headers = {"Content-Type": "application/json"} | ({"Content-Encoding": "gzip"} if packed else {})
    response = shared_client.request(
        method, path, content=gzip.compress(content) if packed else content, headers=headers
    )
    assert response.status_code == 422, response.text
    (problem,) = response.json()["errors"]
    assert (problem["pointer"], problem["code"]) == (where, "duplicate_member")
    assert "send each member once" in problem["detail"]


@pytest.mark.parametrize("number", BEYOND)
def test_integers_that_would_be_changed_are_refused(client: httpx.Client, number: int) -> None:
    url = "/v1/collections/plots/submaps/p"
    body = f'{{"xy": {XY}, "properties": {{"scan": {{"tags": [1, {number}]}}}}}}'
    response = client.put(url, content=body, headers={"Content-Type": "application/json"})
    assert response.status_code == 422
    (problem,) = response.json()["errors"]
    assert (problem["pointer"], problem["code"]) == ("/properties/scan/tags/1", "integer_range")
    assert client.get(url).status_code == 404


def test_what_is_stored_comes_back_as_it_was(client: httpx.Client) -> None:
    url = "/v1/collections/plots/submaps/p"
    properties = {"numbers": [*WITHIN, -0.0, 1e300, 1e-320, 0.1], "texts": ["\x00", "\u2028", "\U0001f600", 'a"\\']}
    client.put(url, json={"xy": points(forest(1)), "properties": properties}).raise_for_status()
    returned = client.get(url).json()["properties"]
    assert json.dumps(returned) == json.dumps(properties)


@pytest.mark.parametrize("number", ["1e999", "-1e999", "NaN", "Infinity", "01", "1_0", "0x10", '"\\ud800"'])
def test_what_is_no_json_is_malformed(client: httpx.Client, number: str) -> None:
    body = f'{{"xy": {XY}, "properties": {{"a": {number}}}}}'
    response = client.put("/v1/collections/plots/submaps/p", content=body, headers={"Content-Type": "application/json"})
    assert (response.status_code, response.json()["type"]) == (400, "/problems/malformed-json"), response.text


def test_lines_of_an_import_are_read_alike(client: httpx.Client) -> None:
    lines = [
        f'{{"id": "a", "xy": {XY}, "id": "b"}}'.encode(),
        f'{{"id": "c", "xy": {XY}, "properties": {{"a": {2**64}}}}}'.encode(),
        f'{{"id": "d", "xy": {XY}}}'.encode(),
    ]
    job = finished(client, upload(client, lines))
    told = results(client, job)
    assert [one["outcome"] for one in told] == ["refused", "refused", "created"]
    pointers = [(one["problem"]["errors"][0]["pointer"], one["problem"]["errors"][0]["code"]) for one in told[:2]]
    assert pointers == [("/id", "duplicate_member"), ("/properties/a", "integer_range")]


fillers = st.recursive(
    st.sampled_from([1, -2.5, "a,b", "]", '{"', "\\", None, "é"]),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(["a", "b", "]"]), inner, max_size=3),
    max_leaves=8,
)
CHANGES = [b"", b",", b"[", b"]", b"{", b"}", b'"', b"\\", b"  ", b",,", b"\xff"]


def _read(read: Callable[[bytes], Any], raw: bytes) -> Any:
    """The content with its order, or the complaint."""
    try:
        content = read(raw)
    except orjson.JSONDecodeError as error:
        return str(error)
    return content, list(content) if isinstance(content, dict) else None


@settings(deadline=None, max_examples=30)
@given(
    st.dictionaries(st.sampled_from(["xy", "queries", "", "["]), st.lists(fillers, min_size=1, max_size=3), max_size=3),
    st.lists(st.tuples(st.floats(0.0, 1.0), st.sampled_from(CHANGES), st.integers(0, 1)), max_size=2),
)
def test_a_large_document_is_read_in_pieces_as_it_is_read_whole(
    arrays: dict[str, list[Any]], changes: list[tuple[float, bytes, int]]
) -> None:
    """Well-formed or not: the same content in the same order, or the same complaint at the same place."""
    long = {name: array * (80_000 // len(orjson.dumps(array))) for name, array in arrays.items()}
    raw = bytearray(orjson.dumps(long))
    for share, put, instead_of in changes:
        at = int(share * len(raw))
        raw[at : at + instead_of] = put
    try:
        got = _read(lambda text: read_json(text, 10**9), bytes(raw))
    except InvalidField:
        return  # a change made a member come twice, or a number too long, which the parser alone does not mind
    assert got == _read(orjson.loads, bytes(raw))


@pytest.mark.parametrize("end", [b",]", b",  ]", b",,1]", b"}", b"]]", b"", b"] 1"])
def test_the_end_of_a_long_array_is_read_strictly(end: bytes) -> None:
    raw = b'{"xy": [' + b",".join([b"[1.0, 2.0]"] * 10_000) + end + b"}"
    with pytest.raises(orjson.JSONDecodeError):
        read_json(raw, 10**9)
