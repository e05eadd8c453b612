"""Every description in the OpenAPI document stands alone: a client's editor shows just that one."""

import re
from collections.abc import Iterator
from typing import Any

import pytest

_RUNS_ON = re.compile(r"^(and|or|but|with(?! `)|of|as|for)\b", re.IGNORECASE)
_NOT_ALONE = re.compile(r"^(Only (these|those)|The (least|most|fewest|latest|earliest|strongest))\b[^`]{0,12}\.$")


def descriptions(node: Any, where: str = "") -> Iterator[tuple[str, str]]:
    """Each description of a field or parameter, and where it stands."""
    if isinstance(node, dict):
        if isinstance(node.get("description"), str) and ("type" in node or "anyOf" in node or "in" in node):
            yield where, node["description"]
        for name, inner in node.items():
            if name not in ("example", "examples", "default"):
                yield from descriptions(inner, f"{where}/{name}")
    elif isinstance(node, list):
        for number, inner in enumerate(node):
            yield from descriptions(inner, f"{where}/{number}")


def faults(text: str) -> list[str]:
    first, last = text[0], text[-1]
    found = []
    if first.islower() and not re.match(r"[a-z]+_T_[a-z]+\b|from_T_to|\w+, \w+", text):
        found.append("begins in the middle of a sentence")
    if last not in ".`)":
        found.append("does not end")
    if _RUNS_ON.match(text):
        found.append("needs the field before it")
    if _NOT_ALONE.match(text) or len(text.split()) == 1:
        found.append("does not say of what")
    return found


@pytest.mark.parametrize(
    "text", ["and as much more for each,", "The least.", "As a candidate's.", "Of the query.", "x"]
)
def test_what_runs_on_is_noticed(text: str) -> None:
    assert faults(text)


def test_every_description_stands_alone(document: dict[str, Any]) -> None:
    told = {where: (text, found) for where, text in descriptions(document) if (found := faults(text))}
    assert not told


def test_every_type_and_member_has_a_description(document: dict[str, Any]) -> None:
    schemas = document["components"]["schemas"]
    bare = [name for name, schema in schemas.items() if not schema.get("description")]
    # A member that is described like its type refers to it alone.
    bare += [
        f"{name}.{member}"
        for name, schema in schemas.items()
        for member, about in schema["properties"].items()
        if not about.get("description") and "$ref" not in about
    ]
    assert not bare


@pytest.mark.parametrize(
    ("schema", "field", "says"),
    [
        ("GatesAnswer", "lead_per_landmark", "parameter of the same name"),
        ("CandidateAnswer", "overlap_ratio", "0 to 1"),
        ("FindingAnswer", "overlap_count", "or of the submap's if those are more"),
        ("CandidateAnswer", "support", "Not comparable between levels"),
        ("FindingAnswer", "support", "Not comparable between levels"),
        ("Inlier", "query", "always strings"),
        ("Inlier", "submap", "always strings"),
    ],
)
def test_a_member_that_could_be_mistaken_says_what_it_is(
    document: dict[str, Any], schema: str, field: str, says: str
) -> None:
    properties = document["components"]["schemas"][schema]["properties"]
    assert says in " ".join(properties[field]["description"].split())
