"""The small parts that HTTP is made of: negotiation, pointers, cursors, poses, pinned threads."""

import gc
import threading
import weakref

import faiss
import pytest

from server.errors import InvalidField, NotAcceptable
from server.http.negotiation import choose
from server.http.problems import domain_problem
from server.parsing.field_errors import pointer
from server.platform.thread_limits import pin_threads
from server.resources.paging import read_cursor, write_cursor
from server.resources.preconditions import Preconditions

OFFERED = ["application/json", "application/geo+json", "image/svg+xml"]


@pytest.mark.parametrize(
    ("accept", "chosen"),
    [
        (None, "application/json"),
        ("", "application/json"),
        ("*/*", "application/json"),
        ("image/*", "image/svg+xml"),
        ("image/svg+xml, */*;q=0.1", "image/svg+xml"),
        ("application/json;q=0.2, application/geo+json;q=0.9", "application/geo+json"),
        ("application/json;q=0, */*", "application/geo+json"),
        ("Image/SVG+XML", "image/svg+xml"),
        ("text/html, application/json;q=0.5", "application/json"),
        ("application/json;q=abc, image/svg+xml", "image/svg+xml"),
    ],
)
def test_negotiation(accept: str | None, chosen: str) -> None:
    assert choose(accept, OFFERED) == chosen


@pytest.mark.parametrize("accept", ["text/html", "application/json;q=0", "nonsense"])
def test_nothing_to_offer(accept: str) -> None:
    with pytest.raises(NotAcceptable, match="Ask for one of"):
        choose(accept, OFFERED)


def test_pointers_are_escaped() -> None:
    assert pointer(["a/b", 3, "c~d", ""]) == "/a~1b/3/c~0d/"
    assert pointer([]) == ""


def test_cursors_come_back_and_forgeries_do_not() -> None:
    assert read_cursor("submaps", None) == 0
    assert read_cursor("submaps", write_cursor("submaps", 12345)) == 12345
    for forged in (write_cursor("collections", 1), "", "é", "[]", write_cursor("submaps", -1), "eyJhIjoxfQ"):
        with pytest.raises(InvalidField):
            read_cursor("submaps", forged)


def test_preconditions_that_are_not_given_always_hold() -> None:
    Preconditions().check(None)
    Preconditions().check("x")
    Preconditions(if_none_match=("*",)).check(None)
    Preconditions(if_match=("a", "x")).check("x")


def test_threads_are_pinned_where_they_compute() -> None:
    counted: list[int] = []

    def work() -> None:
        pin_threads()
        counted.append(faiss.omp_get_max_threads())

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert counted == [1]


class _Body:
    """What a request holds."""


def test_a_handled_error_holds_nothing_of_its_request() -> None:
    """Also where the error and the functions that it passed hold each other, which only the collector would find."""
    held = list["weakref.ref[_Body]"]()

    def answer() -> None:
        body = _Body()
        held.append(weakref.ref(body))
        try:
            read(body)
        except ValueError as error:
            mistake = InvalidField("is not a tree", code="value", pointer="/xy")
            raise mistake from error

    def read(body: _Body) -> None:
        held.append(weakref.ref(body))
        error = ValueError("no tree")
        raise error

    gc.disable()
    try:
        try:
            answer()
        except InvalidField as error:
            response = domain_problem(error, {"type": "http"})
        assert (response.status_code, [one() for one in held]) == (422, [None, None])
    finally:
        gc.enable()
