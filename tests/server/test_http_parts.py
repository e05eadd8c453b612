"""The small parts that HTTP is made of: negotiation, pointers, cursors, poses, pinned threads."""

import threading

import faiss
import numpy as np
import pytest
from numpy.typing import NDArray

from server.errors import InvalidField, NotAcceptable
from server.http.negotiation import choose
from server.paging import read_cursor, write_cursor
from server.preconditions import Preconditions
from server.queries.poses import compose_covariance
from server.schemas.pointers import pointer
from server.threads import pin_threads
from urquhart import SE2

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
    with pytest.raises(NotAcceptable, match="offered"):
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


def test_composed_covariance_follows_the_composition() -> None:
    first, second = (10.0, -4.0, 0.8), (6.0, 9.0, -2.0)
    rng = np.random.default_rng(1)
    roots = rng.normal(size=(2, 3, 3)) * [0.2, 0.1, 0.01]
    one, two = (root @ root.T for root in roots)

    def composed(values: NDArray[np.float64]) -> NDArray[np.float64]:
        pose = SE2(*map(float, values[:3])) @ SE2(*map(float, values[3:]))
        return np.array([pose.x, pose.y, pose.yaw])

    step = 1e-6 * np.eye(6)
    at = np.array([*first, *second])
    jacobian = np.stack([(composed(at + d) - composed(at - d)) / 2e-6 for d in step], axis=1)
    joint = np.zeros((6, 6))
    joint[:3, :3], joint[3:, 3:] = one, two
    expected = jacobian @ joint @ jacobian.T
    assert np.allclose(compose_covariance(SE2(*first), one, SE2(*second), two), expected, rtol=1e-6, atol=1e-9)


def test_threads_are_pinned_where_they_compute() -> None:
    counted: list[int] = []

    def work() -> None:
        pin_threads()
        counted.append(faiss.omp_get_max_threads())

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert counted == [1]
