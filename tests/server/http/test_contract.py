"""Whatever the OpenAPI document allows, and much that it does not: no answer but those that it tells of."""

from collections.abc import Callable
from pathlib import Path

from benchmarks.reliability.contract import examine
from tests.server.processes import Server


def test_every_operation_answers_as_its_document_says(tmp_path: Path, serve: Callable[..., Server]) -> None:
    server = serve(tmp_path / "urquhart.db")
    seen = examine(str(server.client.base_url), rounds=1, each=2, seed=11)
    assert seen.failures == {}
    document = server.client.get("/openapi.json").json()
    operations = {operation["operationId"] for path in document["paths"].values() for operation in path.values()}
    assert set(seen.cases) == operations
    assert seen.cases.total() >= 120
    assert {200, 201, 204, 404, 422} <= {status for _, status in seen.statuses}
    assert "Traceback" not in server.log.read_text()
