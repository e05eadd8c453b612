"""Segments: the same submaps give the same answers, however they were laid out, merged or stored."""

import functools
from pathlib import Path

import numpy as np
import pytest

from tests.urquhart import contents
from tests.urquhart.contents import CONFIG, answers, observations, of_segments, over, place
from tests.urquhart.tables import decode
from urquhart import Config, SegmentDamaged, describe
from urquhart.index import segment
from urquhart.index.polygon_search import merge_partitions
from urquhart.index.segment import FORMAT, Segment, merge_segments
from urquhart.index.segment_file import SegmentFile, writing

PLACES = {key: place(key) for key in range(36)}
SEEN = observations(8)


def build(*keys: int) -> Segment:
    return Segment.build(((key, PLACES[key]) for key in keys), CONFIG)


def living(part: Segment, *dead: int) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    return np.isin(part.keys, dead, invert=True).astype(np.uint8)


def same(one: Segment, other: Segment) -> None:
    """Alike but for the order of quads within a cell and of polygons."""
    assert one.fingerprint == other.fingerprint
    for name in ("keys", "scales", "units"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
        assert getattr(one, name).dtype == getattr(other, name).dtype
    np.testing.assert_array_equal(one.quads.codes, other.quads.codes)
    np.testing.assert_array_equal(one.quads.starts, other.quads.starts)
    assert contents.contents(of_segments([one])) == contents.contents(of_segments([other]))


def test_slots_are_places_among_ascending_keys() -> None:
    part = build(7, 3, 30, 12)
    assert len(part) == 4
    assert part.keys.tolist() == [3, 7, 12, 30]
    assert part.slots(np.array([12, 3, 4, 31, -1, 30, 7])).tolist() == [2, 0, -1, -1, -1, 3, 1]
    assert part.slots(np.empty(0, np.int64)).tolist() == []
    assert set(decode(part.quads).slots.tolist()) == {0, 1, 2, 3}
    assert part.file is None


def test_of_nothing_there_is_an_empty_segment(tmp_path: Path) -> None:
    for part in (
        build(),
        merge_segments([(build(), living(build()))]),
        merge_segments([(build(4), living(build(4), 4))]),
    ):
        assert (len(part), len(part.quads), part.polygons) == (0, 0, {})
        assert part.slots(np.array([4, 5])).tolist() == [-1, -1]
        part.write(tmp_path / "a")
        same(Segment.open(tmp_path / "a"), part)


def test_features_of_another_configuration_are_refused_and_a_key_comes_once() -> None:
    other = describe(PLACES[1].landmarks, Config(samples=32))
    with pytest.raises(ValueError, match="features of submap 9 were made with another configuration"):
        Segment.build([(1, PLACES[1]), (9, other)], CONFIG)
    with pytest.raises(ValueError, match="twice"):
        Segment.build([(1, PLACES[1]), (2, PLACES[2]), (1, PLACES[1])], CONFIG)


def test_landmarks_far_apart_have_larger_units() -> None:
    far = describe(PLACES[1].landmarks * 100.0, CONFIG)
    part = Segment.build([(1, PLACES[1]), (2, far)], CONFIG)
    reach = float(np.abs(far.landmarks).max())
    assert part.units[0] == np.float32(0.01)
    assert part.units[1] * 32_767 >= reach > part.units[0] * 32_767
    assert part.scales[0] == np.float32(0.5)
    assert part.scales[1] * 127.5 >= reach


def test_written_and_opened_it_is_the_same_and_answers_the_same(tmp_path: Path) -> None:
    part = build(*PLACES)
    part.write(tmp_path / "a.segment", since=4, revision=9)
    opened = Segment.open(tmp_path / "a.segment")
    same(opened, part)
    np.testing.assert_array_equal(opened.quads.words, part.quads.words)
    assert opened.file is not None
    assert opened.file.about == {"since": 4, "revision": 9, "format": FORMAT, "fingerprint": CONFIG.fingerprint()}
    opened.file.check()
    plain = answers(over(of_segments([part]), PLACES), SEEN)
    assert answers(over(of_segments([opened]), PLACES), SEEN) == plain
    assert {str(answer[0]) for answer in plain if isinstance(answer, tuple)} == {"matched", "no_match"}
    # Nothing that a search does may reach the file.
    opened.file.check()
    Segment.open(tmp_path / "a.segment").write(tmp_path / "b.segment", since=4, revision=9)
    assert (tmp_path / "b.segment").read_bytes() == (tmp_path / "a.segment").read_bytes()


@pytest.mark.parametrize("stored", [False, True])
def test_merged_they_are_what_is_built_of_the_union_without_the_dead(tmp_path: Path, stored: bool) -> None:
    """A submap that was replaced is dead in one segment and lives in a later one."""
    renewed = place(8, seed=1)
    parts = [
        (build(*range(0, 20, 2)), (4, 8)),
        (Segment.build([(8, renewed), (5, PLACES[5])], CONFIG), ()),
        (build(35, 1, 33), (33,)),
        (build(20, 21), (20, 21)),
        (build(), ()),
    ]
    alive = [living(part, *dead) for part, dead in parts]
    before = [contents.contents(of_segments([part])) for part, _ in parts]
    path = tmp_path / "merged.segment" if stored else None
    merged = merge_segments([(part, a) for (part, _), a in zip(parts, alive, strict=True)], path, since=0)
    expected = {key: PLACES[key] for key in (0, 2, 6, 10, 12, 14, 16, 18, 5, 35, 1)} | {8: renewed}
    union = Segment.build(expected.items(), CONFIG)
    same(merged, union)
    assert [contents.contents(of_segments([part])) for part, _ in parts] == before
    assert answers(over(of_segments([merged]), expected), SEEN) == answers(over(of_segments([union]), expected), SEEN)
    if path is None:
        assert merged.file is None
    else:
        assert merged.file is not None
        assert merged.file.about == {"since": 0, "format": FORMAT, "fingerprint": CONFIG.fingerprint()}
        merged.file.check()
        same(Segment.open(path), union)


def test_stored_segments_are_merged_like_those_in_memory(tmp_path: Path) -> None:
    low, high = build(*range(10)), build(*range(10, 30))
    low.write(tmp_path / "low")
    high.write(tmp_path / "high")
    opened = [Segment.open(tmp_path / name) for name in ("low", "high")]
    merged = merge_segments([(part, living(part, 3, 17)) for part in opened], tmp_path / "both")
    same(merged, build(*({*range(30)} - {3, 17})))
    for name in ("low", "high", "both"):
        file = Segment.open(tmp_path / name).file
        assert file is not None
        file.check()


def test_polygons_in_lists_survive_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    parts = [(part, living(part)) for part in (build(*range(20)), build(*range(20, 36)))]
    monkeypatch.setattr(segment, "merge_partitions", functools.partial(merge_partitions, exact_below=40))
    merged = merge_segments(parts)
    assert any(partition.inverted for partition in merged.polygons.values())
    merged.write(tmp_path / "a")
    opened = Segment.open(tmp_path / "a")
    same(opened, merged)
    assert [p.inverted for p in opened.polygons.values()] == [p.inverted for p in merged.polygons.values()]
    assert answers(over(of_segments([opened]), PLACES), SEEN) == answers(over(of_segments([merged]), PLACES), SEEN)


def test_what_cannot_be_merged_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    other = Segment.build([(1, describe(PLACES[1].landmarks, Config(samples=32)))], Config(samples=32))
    one = build(1, 2, 3)
    with pytest.raises(ValueError, match="of one configuration"):
        merge_segments([(one, living(one)), (other, living(other))], tmp_path / "a")
    with pytest.raises(ValueError, match="must be at least one"):
        merge_segments([], tmp_path / "a")
    monkeypatch.setattr(segment, "MOST_SLOTS", 4)
    two = build(4, 5)
    with pytest.raises(ValueError, match="5 submaps, but a segment holds at most 4"):
        merge_segments([(one, living(one)), (two, living(two))], tmp_path / "a")
    assert list(tmp_path.iterdir()) == []
    assert len(merge_segments([(one, living(one, 2)), (two, living(two, 5))], tmp_path / "a")) == 3


def test_a_merge_that_fails_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one = build(1, 2, 3)

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.posix_fallocate", full)
    for attempt in (lambda: merge_segments([(one, living(one))], tmp_path / "a"), lambda: one.write(tmp_path / "a")):
        with pytest.raises(OSError, match="No space left"):
            attempt()
    assert list(tmp_path.iterdir()) == []


def test_files_of_another_format_or_damaged_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.segment"
    build(1, 2).write(path)
    data = path.read_bytes()
    for position in (3, 20, 65_536):
        path.write_bytes(data[:position] + bytes([data[position] ^ 16]) + data[position + 1 :])
        with pytest.raises(SegmentDamaged):
            Segment.open(path)
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(SegmentDamaged, match="truncated"):
        Segment.open(path)
    for about in ({"format": FORMAT + 1, "fingerprint": "x"}, {}):
        with writing(path) as writer:
            writer.about = about
            writer.put("keys", np.arange(3))
        assert SegmentFile.open(path).about == about
        with pytest.raises(SegmentDamaged, match=f"this version {FORMAT}"):
            Segment.open(path)
    with pytest.raises(FileNotFoundError):
        Segment.open(tmp_path / "nowhere.segment")
