"""Segments: written of rows, listed, opened with suspicion, merged; and files that cannot be trusted."""

import errno
import itertools
import random
import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from server.checks.index import index_discrepancies
from server.collections import crud
from server.index.flushing import flush, rebuild
from server.index.index_folder import IndexFolder
from server.index.segment_merging import FANOUT, plan
from server.schemas.collections import CollectionPut
from server.store.records import SegmentRecord, trusted
from server.store.repositories.feature_rows import FeatureRows
from tests.server.index.index_helpers import Process, damage
from urquhart import Config
from urquhart.index.segment import Segment

KINDS = ["missing", "empty", "truncated", "header", "arrays"]


def again(process: Process) -> Process:
    """The same after a restart."""
    process.close()
    return Process(process.database.path)


def path_of(process: Process, name: str) -> Path:
    return process.indexes.folder.file(name)


# ------------------------------------------------------------------ written


def test_blocks_make_a_chain(process: Process) -> None:
    process.put_many(range(5), batch=2)  # revisions 1 to 3
    process.put_many(range(5, 15))  # one revision, more than a block
    assert flush(process.indexes.flush_context, "plots") == 15
    chain = process.chain()
    assert [(s.since, s.revision, s.submaps) for s in chain] == [(0, 2, 4), (2, 4, 11)]
    assert [s.size for s in chain] == [path_of(process, s.name).stat().st_size for s in chain]
    assert process.files() == sorted(f"{s.name}.segment" for s in chain)
    assert flush(process.indexes.flush_context, "plots") == 0
    process.put("p0", 50)
    process.delete("p1")
    assert flush(process.indexes.flush_context, "plots", least=2) == 0
    assert flush(process.indexes.flush_context, "plots") == 1
    assert [(s.since, s.revision, s.submaps) for s in process.chain()[2:]] == [(4, 6, 1)]
    assert process.held() == {"p0", *(f"p{i}" for i in range(2, 15))}
    assert (process.found(50), process.found(0), process.found(1)) == ("p0", None, None)
    process.agreed()


def test_opening_reads_no_features(process: Process, monkeypatch: pytest.MonkeyPatch) -> None:
    process.put_many(range(12))
    flush(process.indexes.flush_context, "plots")
    process.put("new", 20)
    read: list[int] = []
    stored = FeatureRows.stored

    def watched(self: FeatureRows, keys: set[int]) -> Iterator[object]:
        for row in stored(self, keys):
            read.append(row.key)
            yield row

    monkeypatch.setattr(FeatureRows, "stored", watched)
    process = again(process)
    assert process.held() == {"new", *(f"p{i}" for i in range(12))}
    assert len(read) == 1
    assert process.found(3) == "p3"
    process.close()


def test_a_collection_that_is_dropped_takes_its_files_along(process: Process) -> None:
    process.put_many(range(6))
    process.maintenance.flush_and_merge("plots")
    assert process.files()
    crud.delete(process.database, "plots")
    assert process.indexes.folder.clean_up(grace=60.0) == 0  # young files might be about to be listed
    assert process.indexes.folder.clean_up(grace=0.0) == 1
    assert process.files() == []
    crud.ensure(process.database, "plots", CollectionPut())
    assert process.found(1) is None


def test_deletions_are_forgotten_when_no_segment_needs_them(process: Process) -> None:
    other = Process(process.database.path)
    process.put_many(range(8))
    assert other.held() == {f"p{i}" for i in range(8)}
    for i in range(6):
        process.delete(f"p{i}")
    flush(process.indexes.flush_context, "plots")  # the rows that are left; those that went are in no segment
    assert process.held() == {"p6", "p7"}
    with process.database.read() as tx:
        assert tx.features(1).deleted_since(0) == []
    assert other.held() == {"p6", "p7"}
    process.delete("p6")
    with process.database.read() as tx:
        assert len(tx.features(1).deleted_since(0)) == 1
    assert (other.held(), other.found(6), other.found(7)) == ({"p7"}, None, "p7")
    process.maintenance.flush_and_merge("plots")  # half of the segment is gone: it is rewritten, up to now
    with process.database.read() as tx:
        assert tx.features(1).deleted_since(0) == []
    assert [(s.since, s.revision, s.submaps) for s in process.chain()] == [(0, 8, 1)]
    assert other.held() == {"p7"}
    process.delete("p7")
    process.maintenance.flush_and_merge("plots")
    assert [s.submaps for s in process.chain()] == [0]
    assert (process.held(), other.held()) == (set(), set())
    process.put("p7", 7)
    assert other.found(7) == "p7"
    process.agreed()
    other.close()


def test_deletions_that_a_segment_needs_are_kept(process: Process) -> None:
    process.put_many(range(20))
    flush(process.indexes.flush_context, "plots")
    process.delete("p0")  # the revision after that of the first segment
    process.put_many(range(20, 24))
    flush(process.indexes.flush_context, "plots")
    process = again(process)
    assert process.held() == {f"p{i}" for i in range(1, 24)}
    assert process.found(0) is None
    process.agreed()
    process.close()


def test_rebuilding_leaves_a_running_process_alone(process: Process) -> None:
    other = Process(process.database.path)
    process.put_many(range(10), batch=3)
    other.maintenance.flush_and_merge("plots")
    before = other.chain()
    process.delete("p3")
    told: list[int] = []
    assert rebuild(process.indexes.flush_context, "plots", progress=told.append) == 9
    assert sum(told) == 9
    after = process.chain()
    assert not {s.name for s in before} & {s.name for s in after}
    assert process.files() == sorted(f"{s.name}.segment" for s in after)
    assert [other.found(i) for i in range(10)] == [f"p{i}" if i != 3 else None for i in range(10)]
    other.put("p3", 3)
    assert (other.found(3), process.found(3)) == ("p3", "p3")
    process.agreed()
    other.close()


def test_what_does_not_fit_is_not_listed(process: Process) -> None:
    process.put_many(range(4), batch=1)

    def exchange(old: list[SegmentRecord], *new: tuple[int, int]) -> bool:
        with process.database.write() as tx:
            return tx.segments(1).exchange(old, [SegmentRecord(f"{a}-{b}", a, b, 1, 1) for a, b in new])

    assert not exchange([], (1, 2))  # a gap
    assert not exchange([], (0, 0))  # nothing
    assert not exchange([], (0, 5))  # from after a restored backup
    assert not exchange([SegmentRecord("gone", 0, 1, 1, 1)], (0, 1))  # merged by another meanwhile
    assert not exchange([], (0, 2), (1, 3))
    assert exchange([], (0, 2), (2, 3))
    with process.database.read() as tx:
        chain = tx.segments(1).chain()
        assert tx.segments(2).chain() == ()
    assert [s.name for s in chain] == ["0-2", "2-3"]
    assert not exchange([], (2, 4))
    assert not exchange([chain[0]])
    assert exchange(list(chain), (0, 4))
    assert [trusted(chain), trusted(chain[1:]), trusted(chain[::-1]), trusted(())] == [2, 0, 0, 0]


# ------------------------------------------------------------------ merged


@pytest.mark.parametrize(
    ("living", "sizes", "runs"),
    [
        ([], [], []),
        ([5], [5], []),
        ([100, 20], [100, 20], []),
        ([100, 26], [100, 26], [range(2)]),
        ([200, 20, 6], [200, 20, 6], [range(1, 3)]),
        ([100, 20, 6], [100, 20, 6], [range(3)]),
        ([100, 20, 5, 1], [100, 20, 5, 1], []),
        ([200, 20, 5, 2], [200, 20, 5, 2], [range(1, 4)]),
        ([20] * 50, [20] * 50, [range(43), range(43, 49)]),
        ([74, 10], [100, 10], [range(1)]),
        ([75, 10], [100, 10], []),
        ([0, 10], [100, 10], [range(2)]),
        ([100, 0], [100, 10], [range(1, 2)]),
        ([0], [0], []),
        ([2**24 - 1, 2**24 - 1], [2**24 - 1, 2**24 - 1], []),
    ],
)
def test_what_is_to_be_merged(living: list[int], sizes: list[int], runs: list[range]) -> None:
    assert plan(living, sizes) == runs


@given(st.lists(st.tuples(st.integers(0, 1000), st.integers(0, 1000)), max_size=12))
def test_merging_comes_to_an_end_with_few_segments(counts: list[tuple[int, int]]) -> None:
    living, sizes = [one for one, _ in counts], [one + dead for one, dead in counts]
    for run in reversed(plan(living, sizes)):
        total = sum(living[i] for i in run)
        living[run.start : run.stop], sizes[run.start : run.stop] = [total], [total]
    assert plan(living, sizes) == []
    assert all(a >= FANOUT * b for a, b in itertools.pairwise(living))


def test_merges_keep_what_lives(process: Process) -> None:
    other = Process(process.database.path)
    for first in range(0, 40, 4):
        process.put_many(range(first, first + 4))
        process.put("same", 100 + first)
        process.delete(f"p{first}")
        process.maintenance.flush_and_merge("plots")
        assert process.held() == other.held()
    chain = process.chain()
    assert len(chain) <= 4
    assert process.files() == sorted(f"{s.name}.segment" for s in chain)
    assert (other.found(136), other.found(132), other.found(8), other.found(9)) == ("same", None, None, "p9")
    process.agreed()
    other.close()


def test_what_is_in_memory_is_taken_over_where_it_is_still_right(process: Process) -> None:
    """Another process merges while this one holds submaps in memory, of which some change and others do not."""
    other = Process(process.database.path)
    process.put_many(range(6))
    process.maintenance.flush_and_merge("plots")
    for name, seed in [("x", 50), ("y", 51), ("z", 52)]:
        process.put(name, seed)
    assert other.found(50) == "x"
    process.put("x", 60)
    process.delete("y")
    for i in range(3):
        process.delete(f"p{i}")
    before = process.chain()
    process.maintenance.merge_all("plots")
    assert process.chain() != before
    assert [other.found(seed) for seed in (50, 51, 52, 60)] == [None, None, "z", "x"]
    assert other.held() == process.held() == {"x", "z", "p3", "p4", "p5"}
    process.put("z", 61)
    process.delete("p3")
    process.delete("p4")
    process.maintenance.merge_all("plots")
    assert other.held() == {"x", "z", "p5"}  # the quads of `z` as it is now, in the place of those in memory
    other.close()


# ------------------------------------------------------------------ not to be trusted


@pytest.mark.parametrize("which", [0, -1])
@pytest.mark.parametrize("kind", KINDS)
def test_a_file_that_cannot_be_used(process: Process, kind: str, which: int) -> None:
    process.put_many(range(5), batch=2)
    flush(process.indexes.flush_context, "plots")
    process.put_many(range(5, 7))
    chain = process.chain()
    assert len(chain) == 2
    damage(path_of(process, chain[which].name), kind, random.Random(kind))
    assert [finding.where for finding in index_discrepancies(process.database)] == ["plots"]
    process = again(process)
    assert process.held() == {f"p{i}" for i in range(7)}
    assert [process.found(i) for i in range(8)] == [*(f"p{i}" for i in range(7)), None]
    assert [s.name for s in process.chain()] == [s.name for s in chain][: which % 2]
    assert process.metrics.registry.get_sample_value("urquhart_segments_damaged_total") == 1.0
    process.maintenance.flush_and_merge("plots")
    assert process.chain()[-1].revision >= chain[-1].revision
    process.agreed()
    process.close()


def test_damage_is_found_while_running(process: Process) -> None:
    """The large arrays are not read when a file is opened, but soon after."""
    process.put_many(range(8))
    process.maintenance.flush_and_merge("plots")
    live = process.indexes.live("plots")
    assert live is not None and live.state is not None
    (segment,) = [part.segment for part in live.state.files]
    segment.quads.words[5] ^= np.uint64(1)  # this process's own copy of the page
    process.maintenance.run()
    assert process.chain() == ()
    assert [process.found(i) for i in range(8)] == [f"p{i}" for i in range(8)]
    process.maintenance.run()
    assert [s.submaps for s in process.chain()] == [8]
    process.agreed()


def test_damage_is_not_merged_into_something_sound(process: Process) -> None:
    process.put_many(range(8), batch=4)
    flush(process.indexes.flush_context, "plots")
    assert len(process.chain()) == 2
    live = process.indexes.live("plots")
    assert live is not None and live.state is not None
    live.state.files[1].segment.quads.words[0] ^= np.uint64(1)
    before = process.chain()
    process.maintenance.run()
    assert process.chain() in (before[:1], ())
    process.maintenance.run()
    process.maintenance.run()
    assert process.held() == {f"p{i}" for i in range(8)}
    process.agreed()


def test_the_file_of_another(process: Process) -> None:
    """Of another collection, of another revision, or with other features: each is sound in itself."""
    process.put_many(range(5))
    crud.ensure(process.database, "others", CollectionPut())
    with process.indexes.view("others"):
        pass
    flush(process.indexes.flush_context, "plots")
    process.put_many(range(10, 15))
    flush(process.indexes.flush_context, "plots")
    first, second = process.chain()
    folder, config = process.indexes.folder, Config()
    for listed, key, other, why in [
        (first, 2, config, "collection"),
        (SegmentRecord(first.name, 1, first.revision, 5, 0), 1, config, "since"),
        (SegmentRecord(first.name, 0, 7, 5, 0), 1, config, "revision"),
        (SegmentRecord(first.name, 0, first.revision, 4, 0), 1, config, "submaps"),
        (first, 1, Config(samples=12), "configuration"),
    ]:
        with pytest.raises(ValueError, match=why):
            folder.open(listed, key, other)
    assert len(folder.open(first, 1, config)) == 5
    shutil.copy(folder.file(second.name), folder.file(first.name))
    with pytest.raises(ValueError, match="says name"):
        folder.open(first, 1, config)
    process = again(process)
    assert process.held() == {f"p{i}" for i in (*range(5), *range(10, 15))}
    process.close()


def test_a_segment_of_another_format(process: Process, monkeypatch: pytest.MonkeyPatch) -> None:
    process.put_many(range(5))
    flush(process.indexes.flush_context, "plots")
    (old,) = process.chain()
    process = again(process)
    monkeypatch.setattr("urquhart.index.segment.FORMAT", 99)
    assert [process.found(i) for i in range(5)] == [f"p{i}" for i in range(5)]
    process.maintenance.flush_and_merge("plots")
    (new,) = process.chain()
    assert new.name != old.name
    process.agreed()
    process.close()


def test_a_gap_in_the_list(process: Process) -> None:
    process.put_many(range(12), batch=4)
    flush(process.indexes.flush_context, "plots")
    assert len(process.chain()) == 3
    with process.database.write_connection() as connection:
        connection.exec_driver_sql("DELETE FROM segments WHERE since = 1")
    (finding,) = index_discrepancies(process.database)
    assert "gap" in finding.what
    process = again(process)
    assert process.held() == {f"p{i}" for i in range(12)}
    assert [s.since for s in process.chain()] == [0]
    process.maintenance.flush_and_merge("plots")
    process.agreed()
    process.close()


def test_a_segment_that_was_merged_away_just_now(process: Process, monkeypatch: pytest.MonkeyPatch) -> None:
    process.put_many(range(8), batch=4)
    flush(process.indexes.flush_context, "plots")
    late, opened = Process(process.database.path), IndexFolder.open

    def merged_before(self: IndexFolder, listed: SegmentRecord, key: int, config: Config) -> Segment:
        monkeypatch.undo()
        process.maintenance.flush_and_merge("plots")
        return opened(self, listed, key, config)

    monkeypatch.setattr(IndexFolder, "open", merged_before)
    assert late.held() == {f"p{i}" for i in range(8)}
    assert [s.submaps for s in late.chain()] == [8]
    assert late.metrics.registry.get_sample_value("urquhart_segments_damaged_total") == 0.0
    late.close()


def test_a_segment_that_cannot_be_read_is_left_out_and_kept(
    process: Process, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    process.put_many(range(12), batch=4)
    flush(process.indexes.flush_context, "plots")
    chain = process.chain()
    process = again(process)

    def refused(*_: object) -> Segment:
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr(IndexFolder, "open", refused)
    assert process.held() == {f"p{i}" for i in range(12)}
    process.put("new", 20)
    assert (process.found(20), process.found(3)) == ("new", "p3")
    assert "Too many open files" in caplog.text
    assert process.chain() == chain
    monkeypatch.undo()
    process.maintenance.run()  # looks again when it removes files
    live = process.indexes.live("plots")
    assert live is not None and live.state is not None
    assert live.state.opened == len(live.state.chain)
    assert (process.found(20), process.found(3)) == ("new", "p3")
    process.agreed()
    process.close()


def test_a_database_that_is_only_read(process: Process, tmp_path: Path) -> None:
    process.put_many(range(30), batch=10)
    process.maintenance.flush_and_merge("plots")
    process.put_many(range(30, 50))  # more than is taken into memory where it can be written
    chain = process.chain()
    assert len(chain) == 2  # the query wrote them
    process.close()
    reader = Process(process.database.path, read_only=True)
    assert (reader.found(3), reader.found(45)) == ("p3", "p45")
    files = reader.files()
    reader.maintenance.run()
    assert (reader.chain(), reader.files()) == (chain, files)
    reader.close()
    damage(path_of(process, chain[0].name), "arrays", random.Random(0))
    reader = Process(process.database.path, read_only=True)
    assert (reader.found(3), reader.found(45)) == ("p3", "p45")
    reader.maintenance.run()
    assert (reader.chain(), reader.files()) == (chain, files)
    reader.close()
    copy = tmp_path / "copy.db"  # without its index
    with closing(sqlite3.connect(process.database.path)) as one, closing(sqlite3.connect(copy)) as other:
        one.backup(other)
    reader = Process(copy, read_only=True)
    assert (reader.found(3), reader.found(45)) == ("p3", "p45")
    assert reader.files() == []
    reader.close()


def test_a_link_leads_to_the_same_folder(process: Process, tmp_path: Path) -> None:
    process.put_many(range(6))
    process.maintenance.flush_and_merge("plots")
    link = tmp_path / "link.db"
    link.symlink_to(process.database.path)
    other = Process(link)
    assert other.found(2) == "p2"
    assert other.files() == process.files()
    other.close()
