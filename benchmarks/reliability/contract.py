"""Part `contract`: whatever the OpenAPI document allows, and much that it does not, against a real server.

Cases are drawn from the document by schemathesis: half of them as it describes them, half against it. Names in paths
are mostly those of what earlier answers told of (Location), so that one operation works on what another made. Every
answer is held against the document: its status, its media type, its headers, its schema.
"""

import json
import re
import tempfile
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import httpx
import hypothesis
import orjson
import requests
import schemathesis
from hypothesis import HealthCheck, Phase, given
from hypothesis import strategies as st
from schemathesis.core.result import Ok
from schemathesis.generation import GenerationMode
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
    status_code_conformance,
)

from benchmarks.experiments import Figures
from benchmarks.reliability.trees import body
from benchmarks.server_process import served

_CHECKS: Final = [
    status_code_conformance,
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
]
_FORESEEN: Final = (503, 507)
"""Statuses of 500 and more that are no failure where they are documented."""
_KNOWN: Final = 0.8
"""Share of the cases that name what is there."""
_MENDED: Final = 0.5
"""Share of the bodies with trees that get a forest instead: chance hardly draws one that can be used."""
_LATE: Final = ("deleteCollection",)
"""Asked after all others of a round, since what it takes away they need."""
_TIMEOUT: Final = 60.0


@schemathesis.serializer("application/x-ndjson")
def _ndjson(context: schemathesis.SerializationContext, value: Any) -> bytes:
    """Text as it is; for what is against the document, JSON."""
    return value.encode(errors="replace") if isinstance(value, str) else json.dumps(value, default=str).encode()


@dataclass
class SeenCase:
    """What came of the cases.

    Attributes:
        cases: by operation.
        statuses: by operation and status.
        failures: what is wrong by where it is, each once, with the request that shows it.
        names: of what is there, by the name of the path parameter.
        undrawn: operations for which no such case can be made: all that is sent to them is right.
    """

    cases: Counter[str] = field(default_factory=Counter)
    statuses: Counter[tuple[str, int]] = field(default_factory=Counter)
    failures: dict[str, str] = field(default_factory=dict)
    names: dict[str, list[str]] = field(default_factory=dict)
    undrawn: list[str] = field(default_factory=list)

    def note(self, templates: list[tuple[re.Pattern[str], str]], location: str) -> None:
        """Keep the names in a path that an answer told of."""
        for pattern, _ in templates:
            if (match := pattern.fullmatch(location.split("?")[0])) is not None:
                for name, value in match.groupdict().items():
                    kept = self.names.setdefault(name, [])
                    if value not in kept:
                        kept.append(value)
                        del kept[: max(0, len(kept) - 12)]
                return


def run(*, quick: bool, seed: int) -> Figures:
    """Examine a server with nothing in it but what the cases make."""
    with (
        tempfile.TemporaryDirectory() as folder,
        served(Path(folder) / "contract.db", Path(folder) / "log") as server,
    ):
        seen = examine(server.url, rounds=1 if quick else 4, each=8 if quick else 32, seed=seed)
        logged = server.failures()
    return {
        "cases": seen.cases.total(),
        "operations": dict(sorted(seen.cases.items())),
        "statuses": _by_status(seen),
        "failures": [{"where": where, "what": what} for where, what in sorted(seen.failures.items())],
        "undrawn": sorted(set(seen.undrawn)),
        "logged": logged[:20],
    }


def examine(url: str, *, rounds: int, each: int, seed: int) -> SeenCase:
    """Ask the server at `url` for everything in its document: so many cases of each kind an operation and round."""
    schema = schema_of(url)
    operations = [result.ok() for result in schema.get_all_operations() if isinstance(result, Ok)]
    operations.sort(key=lambda operation: (_id(operation) in _LATE, not _id(operation).startswith("put")))
    templates = [(_pattern(operation.path), operation.path) for operation in operations]
    seen = SeenCase()
    with httpx.Client(base_url=url, timeout=_TIMEOUT) as client, requests.Session() as session:
        for number in range(rounds):
            for operation in operations:
                _seed_bed(client, seen, templates, number)
                for mode in (GenerationMode.POSITIVE, GenerationMode.NEGATIVE):
                    if mode is GenerationMode.POSITIVE or _can_be_wrong(operation):
                        _ask(operation, mode, session, seen, templates, each, seed + number)
    return seen


def schema_of(url: str) -> Any:
    """What the server at `url` says of itself, to draw from."""
    schema = schemathesis.openapi.from_dict(
        httpx.get(f"{url}/openapi.json", timeout=_TIMEOUT).raise_for_status().json()
    )
    schema.config.update(base_url=url)
    return schema


def _ask(
    operation: Any,
    mode: GenerationMode,
    session: requests.Session,
    seen: SeenCase,
    templates: list[tuple[re.Pattern[str], str]],
    each: int,
    seed: int,
) -> None:
    name = _id(operation)

    @hypothesis.seed(seed)
    @hypothesis.settings(
        max_examples=each,
        deadline=None,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(case=operation.as_strategy(generation_mode=mode), draw=st.data())
    def one(case: Any, draw: st.DataObject) -> None:
        for parameter, value in (case.path_parameters or {}).items():
            known = seen.names.get(parameter, [])
            if known and draw.draw(st.floats(0, 1)) < _KNOWN:
                case.path_parameters[parameter] = known[draw.draw(st.integers(0, 11)) % len(known)]
            elif value in (".", ".."):
                case.path_parameters[parameter] = "..."  # a client would take it out of the path
        if isinstance(case.body, str):  # lines: as a string may be any text, half of them get submaps
            case.body = _lines(draw.draw(st.integers(0, 9))) if draw.draw(st.booleans()) else case.body
        trees = isinstance(case.body, dict) and not {"xy", "landmarks"}.isdisjoint(case.body)
        if trees and mode is GenerationMode.POSITIVE and draw.draw(st.floats(0, 1)) < _MENDED:
            taken = ("landmarks", "ids", "submap_id") if draw.draw(st.booleans()) else tuple(case.body)
            kept = {key: value for key, value in case.body.items() if key not in taken}
            case.body = kept | body(draw.draw(st.integers(0, 9)))
        try:
            response = case.call(session=session, timeout=_TIMEOUT)
        except requests.exceptions.InvalidHeader:
            return  # no HTTP client can send that
        except requests.RequestException as error:
            seen.failures.setdefault(f"{name}: no answer", f"{type(error).__name__}: {error}"[:500])
            return
        seen.cases[name] += 1
        seen.statuses[name, response.status_code] += 1
        if response.status_code >= 500 and response.status_code not in _FORESEEN:
            seen.failures.setdefault(f"{name}: {response.status_code}", _shown(case, response.text))
        try:
            case.validate_response(response, checks=_CHECKS)
        except schemathesis.core.failures.FailureGroup as group:
            for failure in group.exceptions:
                seen.failures.setdefault(f"{name}: {failure.title}", _shown(case, str(failure)))
        for location in response.headers.get("location", []):
            seen.note(templates, location)

    try:
        one()
    except hypothesis.errors.Unsatisfiable:
        seen.undrawn.append(f"{name}, {mode.value}")


def _seed_bed(client: httpx.Client, seen: SeenCase, templates: list[tuple[re.Pattern[str], str]], number: int) -> None:
    """Have a collection with submaps and a stored query again: others may have been deleted."""
    base = "/v1/collections/plots"
    client.put(base, json={}).raise_for_status()
    for submap in ("p1", "p2"):
        client.put(f"{base}/submaps/{submap}", json=body(len(submap), number, session="monday"))
        seen.note(templates, f"{base}/submaps/{submap}")
    answer = client.post(f"{base}/queries", json=body(2, number, store=True))
    if location := answer.headers.get("Location"):
        seen.note(templates, f"{location}/candidates/1/match")
    seen.names.setdefault("slug", ["not-found", "too-large"])


def _lines(seed: int) -> str:
    return "".join(orjson.dumps({"id": f"i{line}", **body(seed, line)}).decode() + "\n" for line in range(5)) + "no\n"


def _id(operation: Any) -> str:
    return str(operation.definition.raw["operationId"])


def _can_be_wrong(operation: Any) -> bool:
    return bool(operation.body) or any(True for _ in operation.iter_parameters())


def _pattern(path: str) -> re.Pattern[str]:
    return re.compile(re.sub(r"\\\{(\w+)\\\}", r"(?P<\1>[^/]+)", re.escape(path)))


def _shown(case: Any, what: str) -> str:
    """The request as a command, and what is wrong with the answer."""
    return f"{case.as_curl_command()[:600]} -> {what[:600]}"


def _by_status(seen: SeenCase) -> Figures:
    totals: Counter[str] = Counter()
    for (_, status), count in seen.statuses.items():
        totals[str(status)] += count
    return dict(sorted(totals.items()))
