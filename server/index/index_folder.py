"""The folder of a database's index, which lies beside it: names, opens and removes segment files, and locks work.

Only segments that the database lists count. A file that is not listed is left over. A listed file is checked when it is
opened, and rebuilt if it is not what was listed.
"""

import time
import uuid
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final, Literal

from server.platform.file_locks import try_lock
from server.store.records import SegmentRecord
from server.store.storage import Storage
from urquhart import Config
from urquhart.index.segment import Segment
from urquhart.index.segment_file import SegmentDamaged

LockName = Literal["flush", "merge"]
"""What only one process does at a time."""

_ENDING: Final = ".segment"
_GRACE: Final = 60.0
"""Seconds that a file may wait to be listed."""
_POLL: Final = 0.01


class IndexFolder:
    """The folder `<database file>.index`, made when something is first written to it."""

    def __init__(self, database: Storage) -> None:
        # SQLite follows links too: all who use the file must meet in one folder.
        file = database.path.resolve()
        self.path = file.with_name(f"{file.name}.index")
        self._database = database

    def file(self, name: str) -> Path:
        """Where a segment lies."""
        return self.path / f"{name}{_ENDING}"

    def new_file(self) -> tuple[str, Path]:
        """A name that was never used, and where that segment is to lie. Raises OSError."""
        self.path.mkdir(exist_ok=True)
        name = uuid.uuid4().hex
        return name, self.file(name)

    def open(self, listed: SegmentRecord, collection_key: int, config: Config) -> Segment:
        """Map a listed segment.

        Raises:
            SegmentDamaged: it is not the file that was listed, or of other features than the configuration makes.
            OSError: it is not there, or cannot be read.
        """
        path = self.file(listed.name)
        try:
            segment = Segment.open(path)
        except (KeyError, TypeError) as error:
            raise SegmentDamaged(f"{path.name} lacks {error}") from error
        kept = segment.file.about if segment.file is not None else {}
        for what, value in is_of(listed.name, collection_key, listed.since, listed.revision).items():
            if kept.get(what) != value:
                raise SegmentDamaged(f"{path.name} says {what} {kept.get(what)}, but the database says {value}")
        if len(segment) != listed.submaps:
            raise SegmentDamaged(f"{path.name} contains {len(segment)} submaps, but the database says {listed.submaps}")
        if segment.fingerprint != config.fingerprint():
            raise SegmentDamaged(f"{path.name} was made with another configuration")
        return segment

    @contextmanager
    def lock(self, work: LockName, *, wait: Callable[[], bool] = lambda: False) -> Iterator[bool]:
        """Be the only one, in this process or another, that does such work; whether it is so.

        Args:
            wait: asked again and again, while another does it, whether to go on waiting.

        Raises:
            OSError: the folder cannot be written to.
        """
        self.path.mkdir(exist_ok=True)
        # Held by the open file: it is free again when the process ends, however that comes.
        with (self.path / f"{work}.lock").open("a") as file:
            while not (held := try_lock(file)) and wait():
                time.sleep(_POLL)
            yield held

    def remove(self, names: Iterable[str]) -> None:
        """Remove files that are listed no more; who has mapped them keeps what they hold. Raises OSError."""
        for name in names:
            self.file(name).unlink(missing_ok=True)

    def clean_up(self, grace: float = _GRACE) -> int:
        """Remove what is left over of processes that ended at work, and of collections dropped; how many files.

        Nothing while another process writes: a file is written before it is listed. Raises OSError and StorageError.
        """
        if not self.path.is_dir():
            return 0
        with self.lock("flush") as alone, self.lock("merge") as undisturbed:
            return self._clean_up(grace) if alone and undisturbed else 0

    def _clean_up(self, grace: float) -> int:
        # Looked at before the list is read: what is written in between is young.
        aged = [path for path in self.path.iterdir() if _age(path) >= grace]
        with self._database.read() as tx:
            listed = {f"{name}{_ENDING}" for name in tx.all_segments.names()}
        left = [p for p in aged if p.suffix == ".tmp" or (p.suffix == _ENDING and p.name not in listed)]
        for path in left:
            path.unlink(missing_ok=True)
        return len(left)


def is_of(name: str, collection_key: int, since: int, revision: int) -> dict[str, str | int]:
    """What a segment's file says of itself, so that no other can stand in its place."""
    return {"name": name, "collection": collection_key, "since": since, "revision": revision}


def _age(path: Path) -> float:
    try:
        return time.time() - path.stat().st_mtime
    except FileNotFoundError:
        return -1.0
