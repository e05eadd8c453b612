"""What is written comes back, a file is there whole or not at all, and damage is told."""

import errno
import json
import os
import re
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from urquhart.index import segment_file
from urquhart.index.segment_file import SegmentDamaged, SegmentFile, writing

DTYPES = ("?", "i1", "u1", "<i2", "<u2", "<i4", "<u4", "<i8", "<u8", "<f4", "<f8", "<c16", ">i4")
SHAPES = ((1,), (63,), (64,), (65,), (3, 4, 5), (1, 1), (0,), (0, 7), (5, 0, 2))


def arrays(seed: int = 0) -> dict[str, NDArray[Any]]:
    rng = np.random.default_rng(seed)
    made: dict[str, NDArray[Any]] = {}
    for dtype in DTYPES:
        for shape in SHAPES:
            made[f"{dtype}/{'x'.join(map(str, shape))}"] = rng.integers(0, 100, shape).astype(dtype)
    return made


def write(path: Path, named: dict[str, NDArray[Any]], **about: Any) -> None:
    with writing(path) as writer:
        writer.about = about
        for name, array in named.items():
            writer.put(name, array)


def same(opened: SegmentFile, named: dict[str, NDArray[Any]]) -> None:
    assert list(opened.arrays) == list(named)
    for name, array in named.items():
        got = opened.arrays[name]
        assert (got.dtype, got.shape) == (array.dtype, array.shape)
        np.testing.assert_array_equal(got, array)


def three(path: Path) -> tuple[dict[str, NDArray[Any]], list[tuple[int, int]]]:
    """A file of three arrays, and where in it each lies, from its own header."""
    named = {"first": np.arange(100), "none": np.empty(0), "second": np.arange(41.0), "third": np.arange(77, 90)}
    write(path, named, why="a test")
    data = path.read_bytes()
    _, length, _ = struct.unpack("<8sII", data[:16])
    entries = json.loads(data[16 : 16 + length])["arrays"]
    return named, [(offset, offset + named[name].nbytes) for name, _, _, offset, _ in entries if named[name].nbytes]


def test_many_arrays_come_back_as_they_were_and_so_does_what_is_told_of_them(tmp_path: Path) -> None:
    path, named = tmp_path / "a.segment", arrays()
    about = {"since": 3, "name": "Wälder", "nested": {"x": [1.5, None, True]}}
    write(path, named, **about)
    opened = SegmentFile.open(path)
    same(opened, named)
    assert opened.path == path
    assert opened.about == about
    assert opened.nbytes() == sum(array.nbytes for array in named.values())
    opened.check()
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_without_arrays_is_a_file(tmp_path: Path) -> None:
    write(tmp_path / "a", {}, only="this")
    opened = SegmentFile.open(tmp_path / "a")
    assert (opened.about, dict(opened.arrays), opened.nbytes()) == ({"only": "this"}, {}, 0)
    opened.check()


def test_arrays_are_aligned_plain_and_kept_in_the_order_of_memory(tmp_path: Path) -> None:
    named: dict[str, NDArray[Any]] = {
        "odd": np.arange(13, dtype=np.uint8),
        "turned": np.arange(12).reshape(3, 4).T,
        "some": np.arange(20)[::3],
    }
    write(tmp_path / "a", named)
    opened = SegmentFile.open(tmp_path / "a")
    same(opened, named)
    for array in opened.arrays.values():
        assert type(array) is np.ndarray
        assert array.flags.c_contiguous and array.flags.aligned and array.flags.writeable
        assert array.ctypes.data % 64 == 0


def test_an_array_can_be_filled_where_it_lies(tmp_path: Path) -> None:
    with writing(tmp_path / "a") as writer:
        filled, nothing = writer.empty("filled", (4, 3), np.int32), writer.empty("nothing", 0, np.uint64)
        for row in range(4):
            filled[row] = 10 * row
        writer.put("after", np.arange(3))
        filled[1, 2] = -1
    opened = SegmentFile.open(tmp_path / "a")
    assert opened.arrays["filled"].tolist() == [[0, 0, 0], [10, 10, -1], [20, 20, 20], [30, 30, 30]]
    assert opened.arrays["nothing"].shape == nothing.shape == (0,)
    assert opened.arrays["after"].tolist() == [0, 1, 2]


def test_a_file_appears_when_it_is_complete_and_not_before(tmp_path: Path) -> None:
    path = tmp_path / "a.segment"
    with writing(path) as writer:
        writer.put("x", np.arange(5))
        assert not path.exists()
    assert path.exists()


def test_a_file_is_on_the_disk_before_it_has_its_name_and_its_name_before_it_is_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, synced = tmp_path / "a.segment", list[tuple[str, bool]]()
    sync = os.fsync

    def noted(descriptor: int) -> None:
        synced.append((Path(f"/proc/self/fd/{descriptor}").resolve().name, path.exists()))
        sync(descriptor)

    monkeypatch.setattr(os, "fsync", noted)
    write(path, {"x": np.arange(5)})
    assert [there for _, there in synced] == [False, True]
    assert synced[0][0].startswith("a.segment.")
    assert synced[1][0] == tmp_path.name


@pytest.mark.parametrize("there", [False, True])
def test_when_writing_fails_nothing_is_left_and_what_was_there_stays(tmp_path: Path, there: bool) -> None:
    path = tmp_path / "a.segment"
    if there:
        write(path, {"old": np.arange(7)})
    before = path.read_bytes() if there else None

    def fail() -> None:
        with writing(path) as writer:
            writer.put("x", np.arange(5))
            raise KeyError("half-way")

    with pytest.raises(KeyError, match="half-way"):
        fail()
    assert list(tmp_path.iterdir()) == ([path] if there else [])
    assert (path.read_bytes() if there else None) == before


def test_a_file_is_replaced_as_a_whole_and_who_reads_the_old_one_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "a.segment"
    write(path, {"x": np.arange(50_000)}, version=1)
    old = SegmentFile.open(path)
    write(path, {"x": np.arange(50_000) + 1}, version=2)
    new = SegmentFile.open(path)
    assert (old.about["version"], new.about["version"]) == (1, 2)
    np.testing.assert_array_equal(old.arrays["x"], np.arange(50_000))
    np.testing.assert_array_equal(new.arrays["x"], np.arange(50_000) + 1)
    old.check()
    path.unlink()
    new.check()


@pytest.mark.parametrize("call", [1, 2, 3])
def test_no_room_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: int) -> None:
    """Space is reserved for each array, and for the whole at the end."""
    reserve, calls = os.posix_fallocate, 0

    def full(descriptor: int, offset: int, size: int) -> None:
        nonlocal calls
        calls += 1
        if calls == call:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        reserve(descriptor, offset, size)

    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(OSError, match=re.escape(os.strerror(errno.ENOSPC))) as told:
        write(tmp_path / "a", {"x": np.arange(10), "y": np.arange(10)})
    assert told.value.errno == errno.ENOSPC
    assert list(tmp_path.iterdir()) == []
    monkeypatch.undo()
    write(tmp_path / "a", {"x": np.arange(10)})
    same(SegmentFile.open(tmp_path / "a"), {"x": np.arange(10)})


@pytest.mark.parametrize("many", [False, True])
def test_more_than_a_header_holds_is_refused(tmp_path: Path, many: bool) -> None:
    named = {f"an array with a long name {k}": np.arange(1) for k in range(1_000 if many else 1)}
    with pytest.raises(ValueError, match=r"header of \d+ bytes"):
        write(tmp_path / "a", named, text="" if many else "x" * 65_536)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_not_there_is_an_error_of_the_system(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="nowhere"):
        write(tmp_path / "nowhere" / "a", {"x": np.arange(3)})
    with pytest.raises(FileNotFoundError):
        SegmentFile.open(tmp_path / "a")


def test_a_truncated_file_is_refused_wherever_it_ends(tmp_path: Path) -> None:
    path = tmp_path / "a.segment"
    named, places = three(path)
    data = path.read_bytes()
    lengths = {0, 1, 8, 15, 16, 17, 40, 64, 300, 65_535, 65_536, places[-1][1] - 1}
    lengths |= {at for begin, end in places for at in (begin, begin + 1, (begin + end) // 2, end - 1)}
    for length in sorted(lengths):
        path.write_bytes(data[:length])
        with pytest.raises(SegmentDamaged, match=r"a\.segment"):
            SegmentFile.open(path)
    # What follows the last array is filling.
    path.write_bytes(data[: places[-1][1]])
    same(SegmentFile.open(path), named)


def test_a_flipped_bit_is_told_wherever_it_matters(tmp_path: Path) -> None:
    path = tmp_path / "a.segment"
    named, places = three(path)
    data = path.read_bytes()
    _, length, _ = struct.unpack("<8sII", data[:16])
    rng = np.random.default_rng(0)
    told = {*range(16), *rng.integers(16, 16 + length, 60).tolist()}
    for begin, end in places:
        told |= {begin, end - 1, *rng.integers(begin, end, 20).tolist()}
    for position in sorted(told):
        bit = 1 << int(rng.integers(8))
        path.write_bytes(data[:position] + bytes([data[position] ^ bit]) + data[position + 1 :])
        with pytest.raises(SegmentDamaged, match=r"a\.segment"):
            SegmentFile.open(path)
    for position in (16 + length, 65_535, places[0][1]):
        path.write_bytes(data[:position] + b"\xff" + data[position + 1 :])
        same(SegmentFile.open(path), named)


def test_a_flipped_bit_in_a_large_array_is_told_by_a_check(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(segment_file, "_SMALL", 256)
    path = tmp_path / "a.segment"
    named, places = three(path)
    data = path.read_bytes()
    for position in (places[0][0], places[0][0] + 300, places[0][1] - 1):
        path.write_bytes(data[:position] + bytes([data[position] ^ 1]) + data[position + 1 :])
        opened = SegmentFile.open(path)
        np.testing.assert_array_equal(opened.arrays["third"], named["third"])
        with pytest.raises(SegmentDamaged, match="first is not what was written"):
            opened.check()
    small = places[2][0]
    path.write_bytes(data[:small] + bytes([data[small] ^ 1]) + data[small + 1 :])
    with pytest.raises(SegmentDamaged, match="third is not what was written"):
        SegmentFile.open(path)


def test_large_arrays_are_summed_in_pieces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(segment_file, "_AT_ONCE", 1_000)
    named = {"x": np.random.default_rng(0).integers(0, 255, 12_345, np.uint8)}
    write(tmp_path / "a", named)
    opened = SegmentFile.open(tmp_path / "a")
    assert opened.sums["x"] == zlib.crc32(named["x"].tobytes())
    opened.check()


def test_what_is_not_such_a_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.segment"
    three(path)
    data = path.read_bytes()
    for head in (b"SQLite f", b"URQSEG02", bytes(8)):
        path.write_bytes(head + data[8:])
        with pytest.raises(SegmentDamaged, match="not a segment of this format"):
            SegmentFile.open(path)
    for length in (0, 65_536, 1 << 31, (1 << 32) - 1):
        path.write_bytes(data[:8] + struct.pack("<I", length) + data[12:])
        with pytest.raises(SegmentDamaged, match="damaged header"):
            SegmentFile.open(path)


def test_what_is_written_to_a_mapped_array_reaches_neither_the_file_nor_another_reader(tmp_path: Path) -> None:
    path, named = tmp_path / "a", {"x": np.arange(10_000), "y": np.arange(5.0)}
    write(path, named)
    before = path.read_bytes()
    first, second = SegmentFile.open(path), SegmentFile.open(path)
    first.arrays["x"][:] = -1
    first.arrays["y"][2] = 99.0
    assert path.read_bytes() == before
    same(second, named)
    same(SegmentFile.open(path), named)
    with pytest.raises(SegmentDamaged, match="x is not what was written"):
        first.check()
