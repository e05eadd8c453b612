"""The page of the API is the document's, and the guides lead somewhere."""

import re
from pathlib import Path
from typing import Any

from server.http.documentation.reference import reference
from server.problem_types import PROBLEM_TYPES

DOCS = Path(__file__).parents[3] / "docs"


def test_the_page_is_made_of_the_document(document: dict[str, Any]) -> None:
    assert (DOCS / "api.md").read_text() == reference(document), "urquhart reference > docs/api.md"


def test_every_operation_and_problem_is_on_it(document: dict[str, Any]) -> None:
    page = (DOCS / "api.md").read_text()
    for item in document["paths"].values():
        for operation in item.values():
            assert f"\n### {operation['operationId']}\n" in page
    for slug in PROBLEM_TYPES:
        assert f'<a id="{slug}"></a>' in page


def test_every_type_has_one_table_and_is_linked(document: dict[str, Any]) -> None:
    page = (DOCS / "api.md").read_text()
    headings = [heading.lower() for heading in re.findall(r"^#+ (\w+)$", page, flags=re.MULTILINE)]
    assert len(set(headings)) == len(headings)
    linked = set(re.findall(r"\]\(#([\w-]+)\)", page))
    for name, schema in document["components"]["schemas"].items():
        assert name.lower() in linked, name
        table = page.split(f"\n### {name}\n")[1].split("\n#")[0]
        assert re.findall(r"^\| `(\w+)`", table, flags=re.MULTILINE) == list(schema["properties"])
    assert linked <= {*headings, *PROBLEM_TYPES}


def test_a_nested_type_is_spelled_out() -> None:
    page = (DOCS / "api.md").read_text()
    assert "| `exclude` | [Exclude](#exclude) |" in page
    assert "| `min_confidence` | number above 0.5 and below 1 |" in page
    assert "| `radius` (required) | number above 0 |" in page.split("\n### Near\n")[1]
    assert "| `transform` | [CandidateTransform](#candidatetransform) |" in page.split("\n### CandidateAnswer\n")[1]


def test_the_guides_name_what_there_is(document: dict[str, Any]) -> None:
    text = (DOCS / "guides.md").read_text()
    paths = [re.sub(r"\{[^}]*\}", "x", path) for path in document["paths"]]
    for named in re.findall(r"\$B(/v1[^\s\"?]*)", text):
        segments = named.split("/")
        assert any(
            len(path.split("/")) == len(segments)
            and all(one in ("x", other) for one, other in zip(path.split("/"), segments, strict=True))
            for path in paths
        ), named
    for link in re.findall(r"\]\(([^)#]+)\)", text):
        assert (DOCS / link).resolve().exists(), link
