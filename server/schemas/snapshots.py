"""Bodies of the snapshot routes. The manifest stored beside each snapshot has the same form."""

from datetime import datetime
from typing import Annotated, Any

from pydantic import ConfigDict, Field, PlainSerializer

from server.schemas.common import NEXT, Answer, Body, ResourceId, write_stamp

_Written = Annotated[datetime, PlainSerializer(write_stamp, return_type=str, when_used="json")]


class SnapshotInput(Body):
    """A snapshot to create."""

    model_config = ConfigDict(json_schema_extra={"examples": [{}, {"name": "before-the-season"}]})

    name: ResourceId | None = Field(None, description="Name of the snapshot. By default the time of its creation.")


class SnapshotCollection(Answer):
    """A collection as it is in a snapshot."""

    id: str = Field(description="Id of the collection.")
    revision: int = Field(description="Revision of the collection in the snapshot.")
    submaps: int = Field(description="Number of the collection's submaps in the snapshot.")


class Snapshot(Answer):
    """A copy of the whole database as it was at one moment."""

    model_config = ConfigDict(populate_by_name=True)

    name: str = Field(description="Name of the snapshot.")
    created: _Written = Field(description="When the snapshot was created.")
    size: int = Field(alias="bytes", description="Size of the file, in bytes.")
    sha256: str = Field(description="SHA-256 of the file, in hexadecimal. It is also the entity tag of the download.")
    schema_: str = Field(alias="schema", description="Version of the database schema.")
    version: str = Field(description="Version of the service that created the snapshot.")
    collections: list[SnapshotCollection] = Field(description="The collections in the snapshot, oldest first.")

    def document(self) -> bytes:
        """The snapshot as JSON."""
        return self.model_dump_json(by_alias=True).encode()


class SnapshotPage(Answer):
    """A page of snapshots."""

    snapshots: list[Snapshot] = Field(description="The snapshots of the page, oldest first.")
    next: str | None = Field(None, description=NEXT)

    def document(self) -> bytes:
        """The page as JSON. `next` is left out if it is None."""
        return self.model_dump_json(by_alias=True, exclude={"next"} if self.next is None else None).encode()


SNAPSHOT_EXAMPLE: dict[str, Any] = {
    "name": "before-the-season",
    "created": "2026-05-04T09:30:00Z",
    "bytes": 20844544,
    "sha256": "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08",
    "schema": "0005",
    "version": "0.1.0",
    "collections": [{"id": "plots", "revision": 12, "submaps": 12}],
}
