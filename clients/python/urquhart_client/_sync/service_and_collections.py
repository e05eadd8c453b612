"""Calls for the service and its collections."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Unpack

from urquhart_client._protocol import bodies, requests, stand_requests
from urquhart_client._protocol.bodies import UNSET, Unset
from urquhart_client._sync.connection import Connection
from urquhart_client.models import Collection, Limits
from urquhart_client.stand_models import Stand, StandReceipt
from urquhart_client.stem_maps import FileCutting, FileOptions, FileTrees


class ServiceCalls(Connection):
    """The service and its collections."""

    def landing(self) -> dict[str, Any]:
        """The landing page: name, version and paths of the service."""
        return self._send(requests.get_landing())

    def live(self) -> dict[str, Any]:
        """Return if the process is alive."""
        return self._send(requests.get_probe("livez"))

    def ready(self) -> dict[str, Any]:
        """Return if the service is ready. Otherwise raises a `ProblemError` with status 503 that names the open
        check.
        """
        return self._send(requests.get_probe("readyz"))

    def metrics(self) -> str:
        """The service's metrics, in Prometheus' text format."""
        return self._send(requests.get_metrics())

    def limits(self) -> Limits:
        """The limits of requests."""
        return self._send(requests.get_limits())

    def collections(self, *, page_size: int | None = None) -> Iterator[Collection]:
        """All collections. Pages are fetched as needed."""
        return self._pages(lambda cursor: requests.get_collections(page_size, cursor))

    def get_collection(self, collection: str) -> Collection:
        """One collection, with its counts and revision."""
        return self._send(requests.get_collection(collection))

    def put_collection(
        self,
        collection: str,
        *,
        title: str | None = None,
        config: Mapping[str, Any] | None = None,
        crs: str | None = None,
        origin: Sequence[float] | None = None,
        frames: Mapping[str, Mapping[str, Any]] | None = None,
    ) -> Collection:
        """Create a collection. It may be repeated with the same content; another `config` is refused (409)."""
        return self._send(requests.put_collection(collection, title, config, crs, origin, frames))

    def patch_collection(
        self,
        collection: str,
        *,
        title: str | Unset | None = UNSET,
        crs: str | Unset | None = UNSET,
        origin: Sequence[float] | Unset | None = UNSET,
        frames: Mapping[str, Mapping[str, Any] | None] | Unset = UNSET,
    ) -> Collection:
        """Change members. None removes a member, or the CRS of one of the `frames`."""
        changes = bodies.changes(title=title, crs=crs, origin=origin, frames=frames)
        return self._send(requests.patch_collection(collection, changes))

    def delete_collection(self, collection: str) -> None:
        """Delete a collection and its submaps."""
        self._send(requests.delete_collection(collection))

    def stands(self, collection: str, *, page_size: int | None = None) -> Iterator[Stand]:
        """The stands of a collection, in the order they were first stored. Pages are fetched as needed."""
        return self._pages(lambda cursor: stand_requests.get_stands(collection, page_size, cursor))

    def get_stand(self, collection: str, name: str) -> Stand:
        """One stand: what was stored from one stem map."""
        return self._send(stand_requests.get_stand(collection, name))

    def read_stem_map(self, path: Path, **options: Unpack[FileOptions]) -> FileTrees:
        """Let the service read a file of trees as `urquhart index` does. Nothing is stored.

        Args:
            path: CSV, xlsx, GeoPackage, FlatGeobuf, GeoJSON, KML, GPX, LAS or LAZ.
            options: what is known of the file beforehand.

        Raises:
            ProblemError: the file cannot be used (422, `invalid-file`); `errors` names each row at fault.
            OSError: the file cannot be read here.
        """
        return self._send(stand_requests.read_stem_map(path, options))

    def put_stand(
        self,
        collection: str,
        name: str,
        path: Path,
        *,
        cut: FileCutting | None = None,
        if_match: str | None = None,
        **options: Unpack[FileOptions],
    ) -> StandReceipt:
        """Store a file of trees as a stand, in the place of all that the stand of this name had.

        Args:
            path: the file, as for `read_stem_map`.
            cut: `{"radius": 30, "spacing": 20}`: submaps are circles of that radius, that far apart, in metres; or
                `{"one_submap": True}`: each file, or each of its plots, is one submap. A stand that exists is cut as it
                was if this is left out.
            if_match: the `etag` that must be stored, or `*` for any; otherwise the service refuses (412).
            options: what is known of the file beforehand.

        Raises:
            ProblemError: as `read_stem_map`; nothing is stored.
        """
        return self._send(stand_requests.put_stand(collection, name, path, if_match, {**(cut or {}), **options}))

    def move_stand(
        self,
        collection: str,
        name: str,
        *,
        shift: tuple[float, float] = (0.0, 0.0),
        yaw: float = 0.0,
        about: tuple[float, float] | None = None,
        if_match: str | None = None,
    ) -> Stand:
        """Move all submaps of a stand together in their map frame. Returns the stand.

        Args:
            shift: along x and y of the map frame, metres.
            yaw: radians, counter-clockwise.
            about: the point of the map frame that the stand turns about; the middle of its submaps when left out.
            if_match: the `etag` that must be stored, or `*` for any; otherwise the service refuses (412).
        """
        move = {"shift": shift, "yaw": yaw} if about is None else {"shift": shift, "yaw": yaw, "about": about}
        return self._send(stand_requests.patch_stand(collection, name, if_match, move))

    def delete_stand(self, collection: str, name: str, *, if_match: str | None = None) -> None:
        """Delete a stand with all its submaps. The next query no longer finds them.

        Args:
            if_match: the `etag` that must be stored, or `*` for any; otherwise the service refuses (412).
        """
        self._send(stand_requests.delete_stand(collection, name, if_match))
