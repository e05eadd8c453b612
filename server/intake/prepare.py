"""A posted submap made ready for the store: checked against the limits, hashed, described."""

from dataclasses import replace
from datetime import datetime
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

import urquhart
from server.errors import InvalidLandmarks, TooLarge
from server.schemas.poses import MapPose, PlacedPose
from server.schemas.submaps import LandmarkBody, SubmapInput
from server.settings import Limits
from server.store.codec import (
    digest,
    pack_json,
    pack_positions,
    unpack_attributes,
    unpack_diameters,
    unpack_positions,
)
from server.store.submaps import Identity, Place, SubmapRecord
from server.store.tables import SubmapRow
from urquhart import SE2, Config, Features, LandmarkError


class Prepared:
    """One submap on its way in."""

    def __init__(self, submap_id: str, body: SubmapInput, limits: Limits) -> None:
        """Check sizes and hash the content. Raises TooLarge."""
        check_landmark_count(body, limits)
        check_properties(body.properties, limits)
        self.id = submap_id
        self._body = body
        self._xy = body.positions()
        self.place = place_from(body.map_pose, self._xy)
        self._landmarks = pack_positions(self._xy)
        self._ids = pack_json(body.landmark_ids())
        self._attributes = pack_json(body.attributes())
        self._features: Features | None = None
        self.landmarks_hash = digest(self._landmarks)
        self.etag = content_etag(
            self.landmarks_hash,
            self._ids,
            self._attributes,
            frame_id=body.frame_id,
            session=body.session,
            stamp=body.stamp,
            place=self.place,
            properties=body.properties,
        )

    def describe(self, config: Config) -> Features:
        """Features of the landmarks, made once. Raises InvalidLandmarks."""
        if self._features is None or self._features.fingerprint != config.fingerprint():
            try:
                self._features = urquhart.describe(self._xy, config, self._body.diameters())
            except LandmarkError as error:
                raise invalid_landmarks(error, self._body) from error
        return self._features

    def has_features(self, known: Identity | None) -> bool:
        """Whether what is there has the same positions and diameters, and with them the same features."""
        return known is not None and _same_trees(known, self.landmarks_hash, self._attributes)

    def record(self, known: Identity | None, config: Config) -> SubmapRecord:
        """What to store, given what is known to be there: features are made only for landmarks that are new."""
        if known is not None and self.has_features(known):
            counts, polygons, features = known.counts, known.polygon_count, None
        else:
            made = self.describe(config)
            counts, polygons, features = made.counts(), len(made.tessellation), made.pack()
        body = self._body
        return SubmapRecord(
            id=self.id,
            frame_id=body.frame_id,
            session=body.session,
            stamp=body.stamp,
            landmark_count=len(self._xy),
            polygon_count=polygons,
            counts=counts,
            place=self.place,
            properties=body.properties,
            landmarks_hash=self.landmarks_hash,
            etag=self.etag,
            landmarks=self._landmarks,
            landmark_ids=self._ids,
            attributes=self._attributes,
            features=features,
        )


def settle(record: SubmapRecord, known: Identity | None, config: Config) -> SubmapRecord:
    """A record that was made earlier, made to fit what is known to be there by now.

    Features are left out where they are there, and made where another write took them away meanwhile.
    """
    if known is not None and _same_trees(known, record.landmarks_hash, record.attributes):
        return replace(record, counts=known.counts, polygon_count=known.polygon_count, features=None)
    if record.features is not None:
        return record
    made = urquhart.describe(np.array(unpack_positions(record.landmarks)), config, unpack_diameters(record.attributes))
    return replace(record, counts=made.counts(), polygon_count=len(made.tessellation), features=made.pack())


def _same_trees(known: Identity, landmarks_hash: str, attributes: bytes | None) -> bool:
    if known.landmarks_hash != landmarks_hash:
        return False
    return known.attributes == attributes or (
        unpack_attributes(known.attributes).get("dbh") == unpack_attributes(attributes).get("dbh")
    )


def check_landmark_count(body: LandmarkBody, limits: Limits) -> None:
    """Raise TooLarge for more landmarks than allowed."""
    if body.landmark_count > limits.landmarks:
        raise TooLarge(
            "landmarks",
            limits.landmarks,
            body.landmark_count,
            "Cut the map into overlapping submaps of 50 to 500 trees.",
        )


def check_properties(properties: dict[str, Any] | None, limits: Limits) -> None:
    """Raise TooLarge for larger properties than allowed."""
    size = 0 if properties is None else len(orjson.dumps(properties))
    if size > limits.properties_bytes:
        raise TooLarge(
            "properties_bytes", limits.properties_bytes, size, "Keep large data elsewhere and put a link to it here."
        )


def invalid_landmarks(error: LandmarkError, body: LandmarkBody) -> InvalidLandmarks:
    """The method's refusal, pointed at the field that the landmarks came in."""
    return InvalidLandmarks(body.landmark_pointer, error.code, str(error), error.indices)


def place_from(pose: MapPose | PlacedPose | None, xy: NDArray[np.float64]) -> Place | None:
    """The pose with the footprint of the landmarks ((N, 2) float64, metres, submap frame) in the map."""
    if pose is None:
        return None
    footprint = SE2(pose.x, pose.y, pose.yaw).apply(xy if len(xy) else np.zeros((1, 2)))
    (min_x, min_y), (max_x, max_y) = footprint.min(axis=0), footprint.max(axis=0)
    # The database keeps no -0.0: with it, what is read back would have another entity tag.
    return Place(
        pose.frame_id,
        pose.x + 0.0,
        pose.y + 0.0,
        pose.yaw + 0.0,
        pose.covariance,
        float(min_x),
        float(min_y),
        float(max_x),
        float(max_y),
    )


def content_etag(
    landmarks_hash: str,
    ids: bytes | None,
    attributes: bytes | None,
    *,
    frame_id: str | None,
    session: str | None,
    stamp: datetime | None,
    place: Place | None,
    properties: dict[str, Any] | None,
) -> str:
    """Entity tag of a submap's whole content."""
    pose = place and [place.map_frame_id, place.map_x, place.map_y, place.map_yaw, place.map_covariance]
    rest = orjson.dumps([frame_id, session, stamp, pose, properties], option=orjson.OPT_SORT_KEYS | orjson.OPT_UTC_Z)
    return digest(landmarks_hash.encode(), ids, attributes, rest)


def row_etag(row: SubmapRow, place: Place | None, properties: dict[str, Any] | None) -> str:
    """Entity tag of a stored submap with a pose in the map and properties, its own or others."""
    return content_etag(
        row.landmarks_hash,
        row.landmark_ids,
        row.attributes,
        frame_id=row.frame_id,
        session=row.session,
        stamp=row.stamp,
        place=place,
        properties=properties,
    )
