"""Every parameter of the method, with its default and its unit. One configuration serves all forests."""

import dataclasses
import functools
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

DESCRIPTION_VERSION: Final = 1
FEATURES_FORMAT: Final = 2
FEATURES_VERSION: Final = 100 * DESCRIPTION_VERSION + FEATURES_FORMAT
"""A whole number that changes whenever stored features must be computed again."""
"""Raised whenever the same landmarks and parameters give other features than before; stored ones are then stale."""

_REACH: Final = 3.0
"""A partner may lie this many standard deviations of the usual noise away (99 % of true ones in the plane)."""

_DESCRIPTION: Final = ("samples", "squared", "keep_hull")


class ConfigError(ValueError):
    """A configuration that cannot be used; the message says what is allowed.

    Attributes:
        parameter: name of the parameter at fault.
    """

    def __init__(self, message: str, parameter: str = "") -> None:
        super().__init__(message)
        self.parameter = parameter


def _parameter(default: Any, low: float, high: float, doc: str) -> Any:
    return dataclasses.field(default=default, metadata={"low": low, "high": high, "doc": doc})


@dataclass(frozen=True, slots=True)
class Config:
    """Parameters of the method. Greek letters are the paper's."""

    samples: int = _parameter(20, 4, 256, "points along a polygon's perimeter; the paper's step is 1 / samples")
    squared: bool = _parameter(
        False, 0, 1, "squared centroid distance (the letter) instead of plain (the authors' code)"
    )
    keep_hull: bool = _parameter(False, 0, 1, "keep polygons that touch the hull")

    neighbours: int = _parameter(48, 1, 4096, "nearest polygons asked of the index for each polygon of a query")
    candidates: int = _parameter(24, 1, 10_000, "submaps taken from voting to verification")
    hypotheses: int = _parameter(32, 1, 10_000, "transforms tried for each of them")
    survey: int = _parameter(400, 0, 100_000, "rotations of submaps tried where nothing else finds the query")
    exhaustive_submaps: int = _parameter(64, 0, 10_000, "submaps of these that are verified")
    quad_hits: int = _parameter(200_000, 1_000, 100_000_000, "quad hits, beside four a submap, that are enough")
    sigma: float = _parameter(
        0.25, 0.01, 0.25, "metres; usual error of a coordinate between two observations of a tree"
    )

    gate: float = _parameter(
        6.9, 0.0, 100.0, "least log-odds of being right, for `matched` (6.9 is a confidence of 0.999)"
    )
    lead_per_landmark: float = _parameter(
        0.25, 0.0, 5.0, "lead over the best distinct pose that says nothing, for each landmark"
    )

    covariance_scale: float = _parameter(1.0, 0.01, 1e6, "factor on the covariance of every pose")
    covariance_floor: float = _parameter(
        0.0, 0.0, 1e3, "metres; standard deviation that is added to the x and y of every pose, about the trees' middle"
    )
    covariance_floor_yaw: float = _parameter(
        0.0, 0.0, 3.2, "radians; standard deviation that is added to the yaw of every pose"
    )

    tau: float = _parameter(8.0, 0.0, 1e9, "paper mode: largest descriptor distance of two matching polygons")
    vertex_window: int = _parameter(3, 0, 16, "paper mode: largest difference in vertex count of two matching polygons")
    gamma: int | None = _parameter(None, 1, 100_000, "paper mode: polygons sampled from an observation; null for all")
    eta: float = _parameter(0.5, 0.0, 1.0, "paper mode: share of a polygon's triangles that must find a partner")
    ransac_distance: float = _parameter(0.5, 0.01, 10.0, "paper mode: metres; largest residual of a RANSAC inlier (d)")
    ransac_ratio: float = _parameter(0.99, 0.0, 1.0, "paper mode: share of inliers at which RANSAC stops (r)")
    ransac_iterations: int = _parameter(40_000, 1, 1_000_000, "paper mode: most RANSAC iterations (s)")
    correspondences: int = _parameter(4, 2, 1_000, "paper mode: least correspondences for a pose")

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            _check(field, getattr(self, field.name))

    @classmethod
    def from_dict(cls, values: Mapping[str, object]) -> "Config":
        """A configuration from named values; what is not named keeps its default.

        Raises:
            ConfigError: an unknown name, a wrong type, or a value out of range.
        """
        names = [field.name for field in dataclasses.fields(cls)]
        unknown = sorted(set(values) - set(names))
        if unknown:
            raise ConfigError(f"unknown parameter {unknown[0]!r}: use one of {', '.join(names)}", unknown[0])
        return cls(**values)  # type: ignore[arg-type]  # __post_init__ checks every value

    @property
    def reach(self) -> float:
        """Metres that the partner of a landmark may be away from it in verification."""
        return _REACH * self.sigma

    def to_dict(self) -> dict[str, Any]:
        """Every parameter by name, ready for JSON."""
        return dataclasses.asdict(self)

    def fingerprint(self) -> str:
        """Sixteen hexadecimal digits over all that decides what features look like: stored beside every one of them."""
        return _fingerprint(*(getattr(self, name) for name in _DESCRIPTION))


@functools.lru_cache
def _fingerprint(*values: object) -> str:
    named = dict(zip(_DESCRIPTION, values, strict=True)) | {"version": DESCRIPTION_VERSION}
    return hashlib.sha256(json.dumps(named, sort_keys=True).encode()).hexdigest()[:16]


def _check(field: "dataclasses.Field[Any]", value: object) -> None:
    low, high, default = field.metadata["low"], field.metadata["high"], field.default
    if default is None and value is None:
        return
    if isinstance(default, bool):
        if not isinstance(value, bool):
            raise ConfigError(f"{field.name} must be true or false, not {value!r}", field.name)
        return
    whole = default is None or isinstance(default, int)
    allowed: tuple[type, ...] = (int,) if whole else (int, float)
    if isinstance(value, bool) or not isinstance(value, allowed) or not low <= value <= high:
        noun = "a whole number" if whole else "a number"
        raise ConfigError(f"{field.name} must be {noun} from {low:g} to {high:g}, not {value!r}", field.name)
