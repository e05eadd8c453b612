"""A transport in place of a service, and the documents that it answers."""

import json
from collections.abc import Callable
from typing import Any

import httpx
import numpy as np

from urquhart_client import Client, Retry

COLLECTION: dict[str, Any] = {"id": "plots", "fingerprint": "5e2f", "revision": 3, "counts": {"submaps": 2}}
RECEIPT: dict[str, Any] = {"id": "p7", "collection": "plots", "outcome": "created", "etag": "4be1", "revision": 4}
SUBMAP: dict[str, Any] = {"id": "p7", "collection": "plots", "etag": "4be1", "revision": 4}
CANDIDATE: dict[str, Any] = {
    "rank": 1,
    "submap_id": "p7",
    "transform": {"x": 1.0, "y": 2.0, "yaw": np.pi / 2, "covariance": [1, 0, 0, 0, 1, 0, 0, 0, 1]},
    "map_pose": {"frame_id": "stand", "x": 5.0, "y": 6.0, "yaw": 0.1, "covariance": None},
    "inliers": [{"query": "0", "submap": "t17", "residual": 0.11}],
    "inlier_count": 1,
    "inlier_ratio": 0.9,
    "rms": 0.1,
    "overlap_ratio": 0.8,
    "support": 12,
    "log_odds": 30.5,
    "confidence": 1.0,
    "refused": None,
}
RESULT: dict[str, Any] = {
    "id": None,
    "collection": "plots",
    "verdict": "matched",
    "reason": "verified",
    "method": "robust",
    "revision": 4,
    "lead": None,
    "candidates": [CANDIDATE],
    "stages": [{"name": "features", "milliseconds": 0.8, "counts": {"polygons": 24}}],
}


class FakeService:
    """Answers every request with what the test says, and keeps what came in."""

    def __init__(self, *answers: httpx.Response) -> None:
        self.answers = list(answers)
        self.requests: list[httpx.Request] = []

    def __call__(self, request: httpx.Request) -> httpx.Response:
        self.requests.append(request)
        return self.answers[min(len(self.requests), len(self.answers)) - 1]

    @property
    def last(self) -> httpx.Request:
        return self.requests[-1]

    @property
    def body(self) -> Any:
        return json.loads(self.last.content)


def service(document: object, status: int = 200, **headers: str) -> FakeService:
    return FakeService(httpx.Response(status, json=document, headers=headers))


def client(answering: Callable[[httpx.Request], httpx.Response], base_url: str = "http://service") -> Client:
    """A client that sends nothing again: `test_retries.py` has one that does."""
    return Client(base_url, transport=httpx.MockTransport(answering), retry=Retry(attempts=1))


def sent(answering: FakeService) -> tuple[str, str]:
    return answering.last.method, answering.last.url.raw_path.decode()
