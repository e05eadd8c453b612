"""Partitions of several segments merged into one: what stays, what goes, what is coded again."""

import numpy as np
import pytest

from tests.urquhart.polygons import D, Rows, same, units, whole
from urquhart.config import Config
from urquhart.features.describe import Features
from urquhart.index.polygon_partition import exact_partition
from urquhart.index.polygon_search import (
    Partition,
    build_partitions,
    merge_partitions,
)


def test_exact_merges_equal_one_build(submaps: list[Features]) -> None:
    unit = units(submaps)
    parts = [
        (build_partitions(submaps[a:b], unit[a:b]), np.arange(a, b, dtype=np.int32))
        for a, b in ((0, 2), (2, 3), (3, 5))
    ]
    merged, built = merge_partitions(parts), build_partitions(submaps, unit)
    assert list(merged) == sorted(built)
    assert all(same(merged[count], built[count]) for count in built)


@pytest.mark.parametrize("listed", [False, True])
def test_a_merge_drops_what_is_gone(real: tuple[Partition, Rows], inverted: Partition, listed: bool) -> None:
    source = inverted if listed else real[0]
    slots = np.where(whole(1_000) % 3 == 0, -1, whole(1_000) // 3).astype(np.int32)
    merged = merge_partitions([({5: source}, slots)], exact_below=1_000 if listed else 10**6)[5]
    kept = slots[source.owners] >= 0
    assert merged.inverted == listed
    np.testing.assert_array_equal(merged.owners, slots[source.owners[kept]])
    np.testing.assert_array_equal(merged.outlines, source.outlines[kept])
    np.testing.assert_array_equal(merged.rows(), source.rows()[kept])
    assert merge_partitions([({5: source}, np.full(1_000, -1, np.int32))]) == {}


def test_codes_of_one_byte_do_not_matter_at_the_gate(real: tuple[Partition, Rows], inverted: Partition) -> None:
    order_of = {outline.tobytes(): i for i, outline in enumerate(real[0].outlines)}
    before = real[0].rows()[[order_of[outline.tobytes()] for outline in inverted.outlines]]
    off = np.linalg.norm(inverted.rows() - before, axis=1)
    assert off.max() < 0.05 * Config().tau
    assert inverted.nbytes < (4 + 4 * 5 + D + 1) * len(inverted)


def test_merging_again_changes_no_code_and_takes_over_centroids(inverted: Partition) -> None:
    assert same(merge_partitions([({5: inverted}, whole(1_000))], exact_below=1_000)[5], inverted)
    rng = np.random.default_rng(3)
    fresh = inverted.rows()[::3] + rng.normal(0.0, 0.5, inverted.rows()[::3].shape).astype(np.float32)
    fresh[0] = 1e4
    more = exact_partition(np.zeros(len(fresh), np.int32), np.zeros((len(fresh), 13), np.uint8), fresh)
    parts = [({5: more}, np.array([1_000], np.int32)), ({5: inverted}, whole(1_000))]
    merged = merge_partitions(parts, exact_below=1_000)[5]
    assert same(merged, merge_partitions(parts, exact_below=1_000)[5])
    np.testing.assert_array_equal(merged.centroids, inverted.centroids)
    old = merged.owners < 1_000
    np.testing.assert_array_equal(merged.rows()[old], inverted.rows())
    # One that no code reaches is cut off; all others are where they were.
    off = np.sort(np.linalg.norm(merged.rows()[~old][:, None] - fresh[None, :300], axis=2).min(axis=0))
    assert off[-1] > 1_000.0
    assert off[-2] < 0.6


def test_centroids_are_trained_again_once_lists_have_grown_too_long(inverted: Partition) -> None:
    many = [({5: inverted}, whole(1_000)), *(({5: inverted}, whole(1_000)) for _ in range(5))]
    merged = merge_partitions(many, exact_below=1_000)[5]
    assert len(merged) == 6 * len(inverted)
    assert len(merged.centroids) == round(np.sqrt(len(merged)))
    step_by_step = inverted
    for _ in range(5):
        step_by_step = merge_partitions([({5: step_by_step}, whole(1_000)), many[0]], exact_below=1_000)[5]
    assert 0.5 <= len(step_by_step.centroids) / np.sqrt(len(step_by_step)) <= 2.0


def test_a_component_that_never_varies_is_no_trouble() -> None:
    rng = np.random.default_rng(4)
    rows = rng.normal(0.0, 5.0, (2_000, D)).astype(np.float32)
    rows[:, 3], rows[:, 4] = 0.0, 7.5
    plain = exact_partition(np.zeros(2_000, np.int32), np.zeros((2_000, 13), np.uint8), rows)
    merged = merge_partitions([({5: plain}, whole(1))], exact_below=100)[5]
    np.testing.assert_allclose(merged.rows()[:, 3:5], [[0.0, 7.5]] * 2_000, atol=1e-4)
    alike = exact_partition(plain.owners, plain.outlines, np.ones((2_000, D), np.float32))
    merged = merge_partitions([({5: alike}, whole(1))], exact_below=100)[5]
    np.testing.assert_allclose(merged.rows(), 1.0, atol=1e-4)
