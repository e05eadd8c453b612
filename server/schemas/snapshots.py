"""Bodies of the snapshot routes, and the manifest that lies beside each snapshot: they are the same."""

from datetime import datetime
from typing import Annotated, Any

from pydantic import ConfigDict, Field, PlainSerializer

from server.schemas.common import Answer, Body, ResourceId, write_stamp

_Written = Annotated[datetime, PlainSerializer(write_stamp, return_type=str, when_used="json")]


class SnapshotInput(Body):
    """A snapshot to make."""

    model_config = ConfigDict(json_schema_extra={"examples": [{}, {"name": "before-the-season"}]})

    name: ResourceId | None = Field(None, description="Its name; the time of its making when left out.")


class SnapshotCollection(Answer):
    """A collection as it is in a snapshot."""

    id: str
    revision: int
    submaps: int


class Snapshot(Answer):
    """A copy of the whole database as it was at one moment."""

    model_config = ConfigDict(populate_by_name=True)

    name: str
    created: _Written
    size: int = Field(alias="bytes", description="Size of the file, in bytes.")
    sha256: str = Field(description="Checksum of the file, in hexadecimal; also its entity tag.")
    schema_: str = Field(alias="schema", description="Revision of the database schema.")
    version: str = Field(description="Version of the service that made it.")
    collections: list[SnapshotCollection] = Field(description="What is in it, oldest first.")

    def document(self) -> bytes:
        """As JSON."""
        return self.model_dump_json(by_alias=True).encode()


class SnapshotPage(Answer):
    """A page of snapshots, oldest first."""

    snapshots: list[Snapshot]
    next: str | None = Field(None, description="Cursor of the next page; not there on the last.")

    def document(self) -> bytes:
        """As JSON; `next` is left out when there is none."""
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
