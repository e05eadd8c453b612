"""Data for the method from the store: configurations, and features, which are rebuilt if they cannot be used."""

import logging

import urquhart
from server.errors import StorageUnavailable
from server.store.codec import unpack_diameters, unpack_positions
from server.store.records import CollectionRecord
from urquhart import Config, ConfigError, Features, FeaturesError

_log = logging.getLogger(__name__)


def config_of(collection: CollectionRecord) -> Config:
    """The configuration of a stored collection. Raises StorageUnavailable if this version cannot use it."""
    try:
        return Config.from_dict(collection.config)
    except ConfigError as error:
        raise StorageUnavailable(
            f"The configuration of the collection {collection.id!r} was written by another version of the service and "
            f"cannot be read: {error}"
        ) from error


def features_of(blob: bytes, landmarks: bytes, attributes: bytes | None, config: Config) -> Features:
    """Features of a stored submap. If they are damaged or of another version, the landmarks are described again.

    `landmarks`, `attributes`: as stored. The second case is logged; `urquhart db check` lists the rows.
    """
    try:
        features = Features.unpack(blob)
        if features.fingerprint == config.fingerprint():
            return features
        reason = f"they were made with {features.fingerprint}"
    except FeaturesError as error:
        reason = str(error)
    _log.warning("stored features cannot be used (%s); describing the landmarks again", reason)
    return urquhart.describe(unpack_positions(landmarks), config, unpack_diameters(attributes))
