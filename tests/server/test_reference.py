"""The page of the API is the document's, and the guides lead somewhere."""

import re
from pathlib import Path

from fastapi import FastAPI

from server.http.documentation.reference import reference
from server.problem_types import PROBLEM_TYPES

DOCS = Path(__file__).parents[2] / "docs"


def test_the_page_is_made_of_the_document(app: FastAPI) -> None:
    assert (DOCS / "api.md").read_text() == reference(app.openapi()), "urquhart reference > docs/api.md"


def test_every_operation_and_problem_is_on_it(app: FastAPI) -> None:
    page = (DOCS / "api.md").read_text()
    for item in app.openapi()["paths"].values():
        for operation in item.values():
            assert f"\n### {operation['operationId']}\n" in page
    for slug in PROBLEM_TYPES:
        assert f'<a id="{slug}"></a>' in page


def test_the_guides_name_what_there_is(app: FastAPI) -> None:
    text = (DOCS / "guides.md").read_text()
    paths = [re.sub(r"\{[^}]*\}", "x", path) for path in app.openapi()["paths"]]
    for named in re.findall(r"\$B(/v1[^\s\"?]*)", text):
        segments = named.split("/")
        assert any(
            len(path.split("/")) == len(segments)
            and all(one in ("x", other) for one, other in zip(path.split("/"), segments, strict=True))
            for path in paths
        ), named
    for link in re.findall(r"\]\(([^)#]+)\)", text):
        assert (DOCS / link).resolve().exists(), link
