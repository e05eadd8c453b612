"""Ids in every script, composed and not, from right to left, escaped in every way that URLs know."""

import tempfile
import unicodedata
from pathlib import Path
from typing import Final
from urllib.parse import quote

import httpx

from benchmarks.experiments import Figures
from benchmarks.reliability.trees import body
from benchmarks.server_process import served

_GOOD: Final = (
    "plots", "p~7", "a.b", "...", "-", "_", "~", "0", "A", "é", "Ünïcode", "林", "森林-7", "лес",
    "δάσος", "غابة", "יער", "जंगल", "ป่า", "숲", "𝕱", "Ⅷ", "²", "ﬁ", "ſ", "İ", "ı", "ß", "x" * 128,
    "é" * 128, "con", "nul", "index", "null",
)  # fmt: skip
"""Letters, digits and the four marks, of any script, composed."""
_BAD: Final = (
    "..", ".", "e\u0301", "a b", "a/b", "a\\b", "a%b", "🌲", "a\u202eb", "\u200b", "a\u200db", "a:b", "a?b", "a#b",
    "a;b", "a,b", "a'b", 'a"b', "a<b", "a\x00b", "a\nb", "\ufeffa", "x" * 129, "\U000e0041",
)  # fmt: skip
_RAW: Final = ("%ff", "%c0%ae", "%ed%a0%80", "%", "%2", "%zz", "%00", "a%2fb", "%2e%2e", "a%252fb")
"""Put into the path as they are."""


def run(*, quick: bool, seed: int) -> Figures:
    """Store, read, list, find and delete under each good name; be refused under each bad one."""
    problems: list[str] = []
    with tempfile.TemporaryDirectory() as folder, served(Path(folder) / "names.db", Path(folder) / "log") as server:
        with httpx.Client(base_url=server.url, timeout=60.0) as client:
            for number, name in enumerate(_GOOD):
                problems += [f"{name!a}: {what}" for what in _round(client, name, seed, number)]
            listed = [one["id"] for one in client.get("/v1/collections?limit=1000").json()["collections"]]
            expected = [name for name in _GOOD if unicodedata.is_normalized("NFC", name)]
            if sorted(listed) != sorted(expected):
                problems.append(f"listed are {sorted(set(listed) ^ set(expected))!a} too many or too few")
            for name in _BAD:
                problems += _refused(client, quote(name, safe=""), name)
            for raw in _RAW:
                problems += _refused(client, raw, raw)
        problems += server.failures()
    return {"good": len(_GOOD), "bad": len(_BAD) + len(_RAW), "problems": problems[:40]}


def _round(client: httpx.Client, name: str, seed: int, number: int) -> list[str]:
    path = f"/v1/collections/{quote(name, safe='')}"
    made = client.put(path, json={"title": name})
    if made.status_code != 201:
        return [f"a collection is answered {made.status_code}: {made.text[:150]}"]
    stored = client.put(f"{path}/submaps/{quote(name, safe='')}", json=body(seed, number, session=name, frame_id=name))
    wrong = [] if stored.status_code == 201 else [f"a submap is answered {stored.status_code}: {stored.text[:150]}"]
    location = stored.headers.get("Location", "")
    again = client.get(location)
    if again.status_code != 200 or again.json()["id"] != name or again.json()["session"] != name:
        wrong.append(f"under its Location {location!a} is {again.status_code}")
    answer = client.post(f"{path}/queries", json=body(seed, number)).json()
    if answer.get("verdict") != "matched" or answer["candidates"][0]["submap_id"] != name:
        wrong.append(f"it is not found: {answer.get('verdict')}")
    rows = client.get(f"{path}/submaps", params={"session": name}).json().get("submaps", [])
    if [row["id"] for row in rows] != [name]:
        wrong.append("its session does not list it")
    excluded = client.post(f"{path}/queries", json=body(seed, number, exclude={"submap_ids": [name]})).json()
    if excluded.get("verdict") != "no_match":
        wrong.append(f"left out, it is found all the same: {excluded.get('verdict')}")
    return wrong


def _refused(client: httpx.Client, path: str, name: str) -> list[str]:
    """It must be 4xx under collections and submaps, and nothing may be there afterwards."""
    found = []
    for url in (f"/v1/collections/{path}", f"/v1/collections/plots/submaps/{path}"):
        try:
            response = client.put(url, json=body(1) if "submaps" in url else {})
        except (httpx.TransportError, httpx.InvalidURL) as error:
            found.append(f"{name!a}: {type(error).__name__}")
            continue
        if not 400 <= response.status_code < 500:
            found.append(f"{name!a} to {url[:40]!a} is answered {response.status_code}: {response.text[:100]}")
    return found
