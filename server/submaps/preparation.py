"""A posted submap prepared for the store: checked against the limits, hashed, described."""

from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

import urquhart
from server.config.settings import Limits
from server.errors import InvalidLandmarks, TooLarge
from server.schemas.landmarks import LandmarkBody
from server.schemas.poses import MapPose, PlacedPose
from server.schemas.submaps import SubmapInput, SubmapPatch
from server.store.codec import (
    digest,
    pack_json,
    pack_positions,
    unpack_attributes,
    unpack_diameters,
    unpack_positions,
)
from server.store.submap_records import Identity, Place, SubmapContent, SubmapRecord
from urquhart import SE2, Config, Features, LandmarkError


class Trees:
    """The landmarks of a submap to be stored: positions, ids, attributes, features."""

    def __init__(self, body: LandmarkBody, limits: Limits) -> None:
        """Check their number, and hash them. Raises TooLarge."""
        check_landmark_count(body, limits)
        self.xy = body.positions()
        self.landmarks = pack_positions(self.xy)
        self.ids = pack_json(body.landmark_ids())
        self.attributes = pack_json(body.attributes())
        self.landmarks_hash = digest(self.landmarks)
        self._body = body
        self._features: Features | None = None

    def reuse(self, features: Features) -> None:
        """Use the features of a stored submap with the same landmarks instead of describing them."""
        self._features = features

    def describe(self, config: Config) -> Features:
        """Features of the landmarks, computed once. Raises InvalidLandmarks."""
        if self._features is None or self._features.fingerprint != config.fingerprint():
            try:
                self._features = urquhart.describe(self.xy, config, unpack_diameters(self.attributes))
            except LandmarkError as error:
                raise invalid_landmarks(error, self._body.landmark_pointer) from error
        return self._features


class Prepared:
    """One submap to be stored."""

    def __init__(self, submap_id: str, body: SubmapInput, limits: Limits) -> None:
        """Check sizes and hash the content. Raises TooLarge."""
        self.trees = Trees(body, limits)
        check_properties(body.properties, limits)
        self.id = submap_id
        self._body = body
        self.place = place_from(body.map_pose, self.trees.xy)
        rest = Circumstances(body.frame_id, body.session, body.stamp, self.place, body.properties)
        self.etag = content_etag(self.trees.landmarks_hash, self.trees.ids, self.trees.attributes, rest)

    def describe(self, config: Config) -> Features:
        """Features of the landmarks, computed once. Raises InvalidLandmarks."""
        return self.trees.describe(config)

    def has_features(self, known: Identity | None) -> bool:
        """Whether the stored submap has the same positions and diameters, and so the same features."""
        return known is not None and _same_trees(known, self.trees.landmarks_hash, self.trees.attributes)

    def record(self, known: Identity | None, config: Config) -> SubmapRecord:
        """The record to store, given what is stored already. Features are computed only for new landmarks."""
        if known is not None and self.has_features(known):
            counts, polygons, features = known.counts, known.polygon_count, None
        else:
            made = self.describe(config)
            counts, polygons, features = made.counts(), len(made.tessellation), made.pack()
        body, trees = self._body, self.trees
        return SubmapRecord(
            id=self.id,
            frame_id=body.frame_id,
            session=body.session,
            stamp=body.stamp,
            landmark_count=len(trees.xy),
            polygon_count=polygons,
            counts=counts,
            place=self.place,
            properties=body.properties,
            landmarks_hash=trees.landmarks_hash,
            etag=self.etag,
            landmarks=trees.landmarks,
            landmark_ids=trees.ids,
            attributes=trees.attributes,
            features=features,
        )


def patched(row: SubmapContent, body: SubmapPatch, trees: Trees | None, config: Config) -> SubmapRecord:
    """The record that replaces `row`: with the members of the patch and, if given, the landmarks `trees`.

    Raises InvalidLandmarks, unless the trees were described before.
    """
    given = body.model_fields_set
    if trees is None:
        xy, blobs = (
            unpack_positions(row.landmarks),
            (row.landmarks_hash, row.landmarks, row.landmark_ids, row.attributes),
        )
        counts, polygons, features = row.counts, row.polygon_count, None
    else:
        xy, blobs = trees.xy, (trees.landmarks_hash, trees.landmarks, trees.ids, trees.attributes)
        made = trees.describe(config)
        counts, polygons, features = made.counts(), len(made.tessellation), made.pack()
    place = place_from(body.map_pose, xy) if "map_pose" in given else row.place
    if place is not None and trees is not None:
        box = _footprint(place.map_x, place.map_y, place.map_yaw, xy)
        place = Place(place.map_frame_id, place.map_x, place.map_y, place.map_yaw, place.map_covariance, **box)
    members: dict[str, Any] = {
        name: getattr(body if name in given else row, name) for name in ("frame_id", "session", "stamp", "properties")
    }
    landmarks_hash, landmarks, ids, attributes = blobs
    return SubmapRecord(
        id=row.id,
        landmark_count=len(xy),
        polygon_count=polygons,
        counts=counts,
        place=place,
        landmarks_hash=landmarks_hash,
        etag=content_etag(landmarks_hash, ids, attributes, Circumstances(place=place, **members)),
        landmarks=landmarks,
        landmark_ids=ids,
        attributes=attributes,
        features=features,
        stand_key=row.stand_key,
        **members,
    )


def reconcile(record: SubmapRecord, known: Identity | None, config: Config) -> SubmapRecord:
    """An earlier record, adapted to what is stored by now.

    Features are left out if they are stored, and computed if another write has removed them since.
    """
    if known is not None and _same_trees(known, record.landmarks_hash, record.attributes):
        return replace(record, counts=known.counts, polygon_count=known.polygon_count, features=None)
    if record.features is not None:
        return record
    made = urquhart.describe(unpack_positions(record.landmarks), config, unpack_diameters(record.attributes))
    return replace(record, counts=made.counts(), polygon_count=len(made.tessellation), features=made.pack())


def _same_trees(known: Identity, landmarks_hash: str, attributes: bytes | None) -> bool:
    if known.landmarks_hash != landmarks_hash:
        return False
    return known.attributes == attributes or (
        unpack_attributes(known.attributes).get("dbh_cm") == unpack_attributes(attributes).get("dbh_cm")
    )


def check_landmark_count(body: LandmarkBody, limits: Limits) -> None:
    """Raise TooLarge if there are more landmarks than allowed."""
    if body.landmark_count > limits.landmarks:
        raise TooLarge(
            "landmarks",
            limits.landmarks,
            body.landmark_count,
            "Cut the map into overlapping submaps of 50 to 500 trees.",
        )


def check_properties(properties: dict[str, Any] | None, limits: Limits) -> None:
    """Raise TooLarge if the properties are larger than allowed."""
    size = 0 if properties is None else len(orjson.dumps(properties))
    if size > limits.properties_bytes:
        raise TooLarge(
            "properties_bytes", limits.properties_bytes, size, "Store large data elsewhere and put a link to it here."
        )


def invalid_landmarks(error: LandmarkError, pointer: str) -> InvalidLandmarks:
    """The method's error, with a pointer to the field that has the landmarks."""
    return InvalidLandmarks(pointer, error.code, str(error), error.indices)


def place_from(pose: MapPose | PlacedPose | None, xy: NDArray[np.float64]) -> Place | None:
    """The pose with the footprint of the landmarks ((N, 2) float64, metres, submap frame) in the map."""
    if pose is None:
        return None
    # The database stores no -0.0, so it is replaced here: otherwise the entity tag would change.
    return Place(
        pose.frame_id,
        pose.x + 0.0,
        pose.y + 0.0,
        pose.yaw + 0.0,
        pose.covariance,
        **_footprint(pose.x, pose.y, pose.yaw, xy),
    )


def _footprint(x: float, y: float, yaw: float, xy: NDArray[np.float64]) -> dict[str, float]:
    """The bounding box of the landmarks in the map, in metres, by the names of `Place`."""
    footprint = SE2(x, y, yaw).apply(xy if len(xy) else np.zeros((1, 2)))
    (min_x, min_y), (max_x, max_y) = footprint.min(axis=0).tolist(), footprint.max(axis=0).tolist()
    return {"map_min_x": min_x, "map_min_y": min_y, "map_max_x": max_x, "map_max_y": max_y}


@dataclass(frozen=True, slots=True)
class Circumstances:
    """The content of a submap besides its landmarks."""

    frame_id: str | None
    session: str | None
    stamp: datetime | None
    place: Place | None
    properties: dict[str, Any] | None


def content_etag(landmarks_hash: str, ids: bytes | None, attributes: bytes | None, rest: Circumstances) -> str:
    """Entity tag of a submap's whole content."""
    place = rest.place
    pose = place and [place.map_frame_id, place.map_x, place.map_y, place.map_yaw, place.map_covariance]
    packed = orjson.dumps(
        [rest.frame_id, rest.session, rest.stamp, pose, rest.properties],
        option=orjson.OPT_SORT_KEYS | orjson.OPT_UTC_Z,
    )
    return digest(landmarks_hash.encode(), ids, attributes, packed)


def row_etag(row: SubmapContent, place: Place | None, properties: dict[str, Any] | None) -> str:
    """Entity tag of a stored submap with a map pose and properties, its own or others."""
    rest = Circumstances(row.frame_id, row.session, row.stamp, place, properties)
    return content_etag(row.landmarks_hash, row.landmark_ids, row.attributes, rest)
