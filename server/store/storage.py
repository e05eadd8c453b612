"""The seam of the store: what the service asks of a database, whichever it is.

Rooms above take a `Storage`, open a transaction of it, and read and write records through the repositories that the
transaction has. They see no SQL and no row of a table.
"""

from contextlib import AbstractContextManager
from pathlib import Path
from typing import Protocol

from sqlalchemy import Connection

from server.store.records import CollectionRecord
from server.store.repositories.api_keys import ApiKeyReader, ApiKeys
from server.store.repositories.candidate_rows import CandidateRows
from server.store.repositories.collections import CollectionReader, Collections
from server.store.repositories.feature_rows import FeatureRows
from server.store.repositories.jobs import JobReader, Jobs
from server.store.repositories.map_frames import MapFrameReader, MapFrames
from server.store.repositories.maps.constraints import ConstraintReader, Constraints
from server.store.repositories.queries import Queries, QueryReader
from server.store.repositories.segments import AllSegments, SegmentReader, Segments
from server.store.repositories.sessions import Sessions
from server.store.repositories.stands import StandReader, Stands
from server.store.repositories.stored_responses import ResponseReader, StoredResponses
from server.store.repositories.submaps import SubmapReader, Submaps


class ReadTransaction:
    """Repositories that read, all in one read view: what others commit meanwhile is not seen.

    Those of what belongs to a collection are methods. They take its key and see nothing of other collections.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    @property
    def api_keys(self) -> ApiKeyReader:
        """API keys."""
        return ApiKeyReader(self._connection)

    @property
    def collections(self) -> CollectionReader:
        """Collections."""
        return CollectionReader(self._connection)

    @property
    def jobs(self) -> JobReader:
        """Jobs."""
        return JobReader(self._connection)

    @property
    def responses(self) -> ResponseReader:
        """Responses to writes with an Idempotency-Key."""
        return ResponseReader(self._connection)

    @property
    def all_segments(self) -> AllSegments:
        """Segments of the index of every collection."""
        return AllSegments(self._connection)

    def submaps(self, collection_key: int) -> SubmapReader:
        """Submaps of a collection."""
        return SubmapReader(self._connection, collection_key)

    def sessions(self, collection_key: int) -> Sessions:
        """Sessions of a collection's submaps."""
        return Sessions(self._connection, collection_key)

    def features(self, collection_key: int) -> FeatureRows:
        """Features of a collection's submaps, and which submaps changed or are gone."""
        return FeatureRows(self._connection, collection_key)

    def candidates(self, collection_key: int) -> CandidateRows:
        """What answers tell of a collection's submaps."""
        return CandidateRows(self._connection, collection_key)

    def map_frames(self, collection: CollectionRecord) -> MapFrameReader:
        """Where a collection's map frames are on Earth."""
        return MapFrameReader(self._connection, collection)

    def segments(self, collection_key: int) -> SegmentReader:
        """Segments of a collection's index."""
        return SegmentReader(self._connection, collection_key)

    def stands(self, collection_key: int) -> StandReader:
        """Stands of a collection."""
        return StandReader(self._connection, collection_key)

    def constraints(self, collection_key: int) -> ConstraintReader:
        """Constraints between a collection's submaps."""
        return ConstraintReader(self._connection, collection_key)

    def queries(self, collection_key: int) -> QueryReader:
        """Stored queries of a collection."""
        return QueryReader(self._connection, collection_key)


class WriteTransaction(ReadTransaction):
    """Repositories that read and write. Everything is committed at the end of the block, or nothing if it raises.

    No other transaction writes meanwhile.
    """

    @property
    def api_keys(self) -> ApiKeys:
        return ApiKeys(self._connection)

    @property
    def collections(self) -> Collections:
        return Collections(self._connection)

    @property
    def jobs(self) -> Jobs:
        return Jobs(self._connection)

    @property
    def responses(self) -> StoredResponses:
        return StoredResponses(self._connection)

    def submaps(self, collection_key: int) -> Submaps:
        return Submaps(self._connection, collection_key)

    def map_frames(self, collection: CollectionRecord) -> MapFrames:
        return MapFrames(self._connection, collection)

    def segments(self, collection_key: int) -> Segments:
        return Segments(self._connection, collection_key)

    def stands(self, collection_key: int) -> Stands:
        return Stands(self._connection, collection_key)

    def constraints(self, collection_key: int) -> Constraints:
        return Constraints(self._connection, collection_key)

    def queries(self, collection_key: int) -> Queries:
        return Queries(self._connection, collection_key)


class Storage(Protocol):
    """A database. Thread-safe. It can be pickled, and the process that unpickles it opens it for itself."""

    @property
    def path(self) -> Path:
        """Where it is. The folders of jobs, snapshots and segments lie beside it, under names that begin like this."""

    @property
    def read_only(self) -> bool:
        """Whether nothing can be written."""

    def read(self) -> AbstractContextManager[ReadTransaction]:
        """Begin a read transaction, which no writer disturbs. Raises StorageError."""

    def write(self, *, shares: bool = False) -> AbstractContextManager[WriteTransaction]:
        """Begin a write transaction. It is durable once the block is left. Raises StorageError.

        `shares`: it is short, and may be made durable together with others. One that fails undoes nothing of theirs.
        """
