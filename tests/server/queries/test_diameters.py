"""Stem diameters over HTTP: evidence where both sides have them, never a condition, the same however they came in."""

from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from fastapi import FastAPI
from numpy.typing import NDArray

from server.app import create_app
from server.checks.database import discrepancies
from server.config.settings import Settings
from server.service_parts import Service
from server.stem_maps.reader import read_stem_map
from server.stem_maps.stands import cut_stand, store_stand
from server.submaps.bulk_ingest import LineOptions
from tests.server.factories import TestClient, points
from urquhart import SE2
from urquhart.evaluation.simulation import Sensor, observe, plantation

PLOTS = "/v1/collections/plots"
QUERIES = f"{PLOTS}/queries"
POSE, ELSEWHERE = SE2(60.0, 55.0, 0.3), SE2(61.0, 57.0, -2.0)
TRUTH = POSE.inverse() @ ELSEWHERE
RNG = np.random.default_rng(1)
ROWS = plantation(120.0, 110.0, np.random.default_rng(8), jitter=0.05, survival=0.97)
STEMS = 100.0 * np.exp(RNG.normal(np.log(0.25), 0.45, len(ROWS)))
STORED = observe(ROWS, POSE, Sensor(25.0, sigma=0.1, detection=0.95), RNG)
ASKED = observe(ROWS, ELSEWHERE, Sensor(25.0, sigma=0.1, detection=0.95), RNG)
THERE, HERE = (STEMS[seen.trees] * np.exp(RNG.normal(0.0, 0.08, len(seen.trees))) for seen in (STORED, ASKED))


def landmarks(xy: NDArray[np.float64], dbh_cm: NDArray[np.float64] | None) -> dict[str, Any]:
    """A body of landmarks, with diameters where they are known."""
    listed: list[dict[str, float]] = [{"x": x, "y": y} for x, y in points(xy)]
    if dbh_cm is not None:
        for tree, diameter in zip(listed, dbh_cm.tolist(), strict=True):
            if not np.isnan(diameter):
                tree["dbh_cm"] = diameter
    return {"landmarks": listed}


def put(client: httpx.Client, submap: str, dbh_cm: NDArray[np.float64] | None) -> dict[str, Any]:
    """Store the observation, with or without diameters."""
    response = client.put(f"{PLOTS}/submaps/{submap}", json=landmarks(STORED.xy, dbh_cm)).raise_for_status()
    receipt: dict[str, Any] = response.json()
    return receipt


def ask(client: httpx.Client, dbh_cm: NDArray[np.float64] | None, **fields: Any) -> dict[str, Any]:
    """Ask with the other observation."""
    response = client.post(QUERIES, json=landmarks(ASKED.xy, dbh_cm) | fields).raise_for_status()
    answer: dict[str, Any] = response.json()
    return answer


def evidence(answer: dict[str, Any]) -> float:
    value: float = answer["candidates"][0]["evidence"]
    return value


def right(answer: dict[str, Any]) -> bool:
    pose = answer["candidates"][0]["transform"]
    metres, radians = SE2(pose["x"], pose["y"], pose["yaw"]).distance(TRUTH)
    return metres < 1.0 and radians < 0.05


def test_stems_tell_the_rows_of_a_plantation_apart(client: httpx.Client) -> None:
    put(client, "rows", THERE)
    without, measured = ask(client, None), ask(client, HERE)
    assert (without["verdict"], without["reason"]) == ("ambiguous", "rival_too_close")
    assert without["rivals"]
    assert (measured["verdict"], measured["rivals"]) == ("matched", [])
    assert right(measured)


def test_a_stored_submap_is_asked_with_its_diameters(client: httpx.Client) -> None:
    put(client, "rows", THERE)
    client.put(f"{PLOTS}/submaps/asked", json=landmarks(ASKED.xy, HERE)).raise_for_status()
    answer = client.post(QUERIES, json={"submap_id": "asked"}).json()
    assert (answer["verdict"], answer["candidates"][0]["submap_id"]) == ("matched", "rows")
    assert evidence(answer) == pytest.approx(evidence(ask(client, HERE, exclude={"submap_ids": ["asked"]})))


def test_on_one_side_only_they_change_nothing(client: httpx.Client) -> None:
    put(client, "rows", None)
    plain = evidence(ask(client, None))
    assert evidence(ask(client, HERE)) == plain
    put(client, "rows", THERE)
    few = np.full(len(HERE), np.nan)
    few[:5] = HERE[:5]
    assert evidence(ask(client, None)) == evidence(ask(client, few)) == plain


def test_a_bias_of_the_calliper_changes_nothing(client: httpx.Client) -> None:
    """Diameters count by how they compare within their own stand, so one factor for all of them is no matter."""
    put(client, "rows", THERE)
    right_measure = evidence(ask(client, HERE))
    for factor in (0.5, 1.1, 2.0):
        assert evidence(ask(client, HERE * factor)) == pytest.approx(right_measure, abs=1e-3)


def test_shuffled_diameters_never_make_a_wrong_match(client: httpx.Client) -> None:
    put(client, "rows", THERE)
    rng = np.random.default_rng(2)
    for _ in range(15):
        answer = ask(client, rng.permutation(HERE))
        assert answer["verdict"] != "matched" or right(answer)


def test_other_diameters_alone_are_found_by_the_next_query(client: httpx.Client, service: Service) -> None:
    put(client, "rows", np.random.default_rng(3).permutation(THERE))
    before = ask(client, HERE)
    assert put(client, "rows", THERE)["outcome"] == "replaced"
    after = ask(client, HERE)
    assert evidence(after) > evidence(before) + 20.0
    assert put(client, "rows", THERE)["outcome"] == "unchanged"
    assert list(discrepancies(service.database)) == []


def test_what_is_known_besides_describes_nothing_again(client: httpx.Client) -> None:
    put(client, "rows", THERE)
    kept = ask(client, HERE, store=True)["candidates"][0]["links"]["match"]
    body = landmarks(STORED.xy, THERE)
    body["landmarks"][0]["species"] = "oak"
    assert client.put(f"{PLOTS}/submaps/rows", json=body).json()["outcome"] == "replaced"
    assert client.get(kept).status_code == 200
    put(client, "rows", THERE * 1.1)
    assert client.get(kept).status_code == 410


def test_features_of_an_older_format_are_described_again(
    app: FastAPI, settings: Settings, caplog: pytest.LogCaptureFixture
) -> None:
    with TestClient(app) as client:
        client.put(PLOTS, json={}).raise_for_status()
        put(client, "rows", THERE)
        before = ask(client, HERE)
    database = create_app(settings).state.service.database
    with database.write_connection() as connection:
        # The format's number is the two bytes behind the four of the magic.
        connection.exec_driver_sql(
            "UPDATE submaps SET features = CAST(substr(features, 1, 4) || x'0100' || substr(features, 7) AS BLOB)"
        )
    (found,) = discrepancies(database)
    assert (found.where, "features of format 1" in found.what) == ("plots/rows", True)
    database.dispose()
    with TestClient(create_app(settings)) as client:
        after = ask(client, HERE)
        assert (after["verdict"], evidence(after)) == ("matched", evidence(before))
        assert "describing the landmarks again" in caplog.text
        assert client.get(f"{PLOTS}/submaps/rows/tessellation").status_code == 200
        assert client.get(f"{PLOTS}/submaps/rows").json()["landmarks"][0]["dbh_cm"] == THERE[0]


def test_the_check_finds_features_without_the_stored_diameters(client: httpx.Client, service: Service) -> None:
    put(client, "rows", THERE)
    put(client, "plain", None)
    assert list(discrepancies(service.database)) == []
    with service.database.write_connection() as connection:
        connection.exec_driver_sql(
            "UPDATE submaps SET features = (SELECT features FROM submaps WHERE id = 'plain') WHERE id = 'rows'"
        )
    (found,) = discrepancies(service.database)
    assert (found.where, found.what) == ("plots/rows", "the features are not those of the landmarks")


def test_stems_that_an_older_version_let_in_count_as_not_known(client: httpx.Client, service: Service) -> None:
    put(client, "rows", THERE)
    with service.database.write_connection() as connection:
        connection.exec_driver_sql(
            "UPDATE submaps SET features = x'00', "
            "attributes = CAST(replace(CAST(attributes AS TEXT), ?, '1e300') AS BLOB)",
            (repr(float(THERE[0])),),
        )
    with TestClient(create_app(service.settings)) as again:
        assert ask(again, HERE)["verdict"] == "matched"


@pytest.mark.parametrize(
    ("dbh_cm", "code"),
    [(-30, "greater_than"), (0, "greater_than"), (0.31, "diameter_range"), (3100, "diameter_range"),
     (1e300, "diameter_range"), (1e-300, "diameter_range"), (0.99, "diameter_range"), (501, "diameter_range"),
     ("30", "float_type"), (True, "float_type"), ([30], "float_type")],
)  # fmt: skip
def test_diameters_that_cannot_be(shared_client: httpx.Client, dbh_cm: Any, code: str) -> None:
    body = landmarks(STORED.xy, None)
    body["landmarks"][3]["dbh_cm"] = dbh_cm
    for response in (shared_client.put(f"{PLOTS}/submaps/bad", json=body), shared_client.post(QUERIES, json=body)):
        assert response.status_code == 422
        (error,) = response.json()["errors"]
        assert (error["pointer"], error["code"]) == ("/landmarks/3/dbh_cm", code)
    assert shared_client.get(f"{PLOTS}/submaps/bad").status_code == 404


def test_a_diameter_or_height_in_another_unit_is_told_so(client: httpx.Client) -> None:
    for name, value, words in (
        ("dbh_cm", 0.31, ["in centimetres, from 1 to 500", "0.31", "in metres?"]),
        ("dbh_cm", 3100, ["in centimetres, from 1 to 500", "3100", "in millimetres?"]),
        ("height_m", 1850.0, ["in metres, up to 150", "1850", "centimetres or feet"]),
        ("dbh", 0.31, ["dbh is given in centimetres as dbh_cm: 0.31 m is 31"]),
        ("height", 18.5, ["height is given in metres as height_m"]),
    ):
        body = landmarks(STORED.xy, None)
        body["landmarks"][3][name] = value
        for response in (client.put(f"{PLOTS}/submaps/bad", json=body), client.post(QUERIES, json=body)):
            (error,) = response.json()["errors"]
            assert error["pointer"] == f"/landmarks/3/{name}"
            assert all(word in error["detail"] for word in words), error["detail"]
    body = landmarks(STORED.xy, None)
    body["landmarks"][3] |= {"dbh_cm": 500.0, "height_m": 150.0}
    body["landmarks"][4] |= {"dbh_cm": 1.0}
    assert client.post(QUERIES, json=body).status_code == 200


def test_a_diameter_is_a_json_number(client: httpx.Client) -> None:
    text = '{"landmarks": [{"x": 1, "y": 2, "dbh_cm": NaN}]}'
    response = client.post(QUERIES, content=text, headers={"Content-Type": "application/json"})
    assert response.status_code == 400


def test_bulk_ingest_describes_with_diameters(service: Service, client: httpx.Client, tmp_path: Path) -> None:
    rows = zip(STORED.xy.tolist(), THERE.tolist(), strict=True)
    file = tmp_path / "stand.csv"
    file.write_text("x_m,y_m,dbh_cm\n" + "".join(f"{x},{y},{dbh_cm}\n" for (x, y), dbh_cm in rows))
    stem_map = read_stem_map(file)
    limits = service.settings.limits
    report = store_stand(
        service.database, "plots", stem_map, cut_stand(stem_map, 40.0, 100.0, limits), LineOptions(limits=limits)
    )
    assert report.outcome.created == 1
    assert ask(client, None)["verdict"] == "ambiguous"
    assert ask(client, HERE)["verdict"] == "matched"
    assert list(discrepancies(service.database)) == []
