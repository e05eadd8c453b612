"""The options that say roughly where trees were observed: a prior for the search."""

import inspect
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import Annotated, Any, Final

import numpy as np
import typer
from numpy.typing import NDArray

from server.commands.support.failure import CommandError
from server.store.storage import Storage
from urquhart.prior.prior import LEAST_NOISE, MOST_NOISE

_PANEL: Final = "Where the trees were observed"
_FAR: Final = 1_000.0
"""Metres from the trees to the point that is known, beyond which that is hardly what was meant."""
_AT_SIGMA: Final = 5.0
"""Metres: standard deviation of --at if none is given."""
_HEADING_SIGMA: Final = 2.0
"""Degrees: standard deviation of --heading if none is given."""
_FRAMES: Final = 5
"""Most map frames that an error names."""


@dataclass(frozen=True, slots=True)
class PlaceOptions:
    """What the command line says of the place. Members are those of `PLACE_OPTIONS`.

    Attributes:
        at, about: "E,N" and "X,Y", metres, as they were written.
        at_sigma, noise: metres.
        heading, heading_sigma: degrees, clockwise.
    """

    at: str | None = None
    at_sigma: float | None = None
    heading: float | None = None
    heading_sigma: float | None = None
    about: str | None = None
    frame: str | None = None
    noise: float | None = None

    def prior(self, storage: Storage, collection: str, xy: NDArray[np.float64]) -> dict[str, Any] | None:
        """The member `prior` of a query; None if no place is given.

        Args:
            storage: the database, for the map frames of the collection.
            xy: (N, 2), metres, the observed trees.

        Raises:
            CommandError: an option cannot be used, or the map frame must be named.
        """
        if self.at is None:
            given = [name for name in PLACE_OPTIONS if getattr(self, name) is not None]
            if given:
                raise CommandError(
                    f"--{given[0].replace('_', '-')} needs --at E,N: roughly where the trees were observed"
                )
            return None
        if self.heading is None and self.heading_sigma is not None:
            raise CommandError("--heading-sigma needs --heading DEG: which way the y axis of the file points")
        about = (0.0, 0.0) if self.about is None else pair("--about", self.about)
        if len(xy):
            _check_near(about, xy)
        x, y = pair("--at", self.at)
        sigma = _AT_SIGMA if self.at_sigma is None else self.at_sigma
        turned = math.radians(_HEADING_SIGMA if self.heading_sigma is None else self.heading_sigma)
        place = {
            "frame_id": self.frame or only_frame(storage, collection),
            "x": x,
            "y": y,
            "about": about,
            "covariance": [sigma**2, 0.0, 0.0, 0.0, sigma**2, 0.0, 0.0, 0.0, turned**2],
        }
        if self.heading is not None:
            place["yaw"] = math.radians(-self.heading)
        return place if self.noise is None else {**place, "noise": self.noise}


def _option(help_text: str, metavar: str, *, least: float | None = None, most: float | None = None) -> Any:
    return typer.Option(help=help_text, metavar=metavar, rich_help_panel=_PANEL, min=least, max=most)


PLACE_OPTIONS: Final[dict[str, Any]] = {
    "at": Annotated[
        str | None,
        _option(
            "Roughly where FILE's point 0,0 is in the map, in metres even if the map's system is in feet. Only poses "
            "near it are searched.",
            "E,N",
        ),
    ],
    "at_sigma": Annotated[
        float | None,
        _option(
            f"Standard deviation of --at in metres. Up to 3.5 times as far is searched. (default: {_AT_SIGMA:g})",
            "M",
            least=0.01,
            most=1e4,
        ),
    ],
    "heading": Annotated[
        float | None,
        _option(
            "Bearing of FILE's y axis in the map, in degrees clockwise from north: 0 if it points north. (default: "
            "unknown)",
            "DEG",
            least=-360.0,
            most=360.0,
        ),
    ],
    "heading_sigma": Annotated[
        float | None,
        _option(
            f"Standard deviation of --heading in degrees. (default: {_HEADING_SIGMA:g})", "DEG", least=0.01, most=180.0
        ),
    ],
    "about": Annotated[str | None, _option("The point of FILE that --at is the place of, if that is not 0,0.", "X,Y")],
    "frame": Annotated[str | None, _option("Map frame of --at. (default: the only one)", "NAME")],
    "noise": Annotated[
        float | None,
        _option(
            "Roughly how far trees are off in the map, in metres along each axis, such as tree tops seen from the air. "
            "(default: 0.3 to 1)",
            "M",
            least=LEAST_NOISE,
            most=MOST_NOISE,
        ),
    ],
}
"""By the members of `PlaceOptions`."""


def reads_place(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command all of `PLACE_OPTIONS`; it gets them as one `PlaceOptions`, its parameter `place`."""
    signature = inspect.signature(command, eval_str=True)
    own = [one for one in signature.parameters.values() if one.name != "place"]
    unset = PlaceOptions()
    options = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=getattr(unset, name), annotation=annotation)
        for name, annotation in PLACE_OPTIONS.items()
    ]

    @wraps(command)
    def run(**given: Any) -> None:
        members = {name: given.pop(name) for name in PLACE_OPTIONS}
        command(**given, place=PlaceOptions(**members))

    del run.__wrapped__
    run.__signature__ = signature.replace(parameters=[*own, *options])  # type: ignore[attr-defined]
    run.__annotations__ = {one.name: one.annotation for one in (*own, *options)} | {"return": None}
    return run


def pair(option: str, text: str) -> tuple[float, float]:
    """Two numbers with a comma between them. Raises CommandError."""
    parts = text.split(",")
    try:
        x, y = (float(part) for part in parts)
    except ValueError:
        x = y = math.nan
    if len(parts) != 2 or not (math.isfinite(x) and math.isfinite(y)):
        raise CommandError(f"{option} must be two numbers in metres, such as 448146.7,5411103.1, not {text!r}")
    return x, y


def _check_near(about: tuple[float, float], xy: NDArray[np.float64]) -> None:
    """Raise CommandError if the point that is known is far from all trees."""
    away = float(np.hypot(*(xy - about).T).min())
    if away > _FAR:
        x, y = xy.mean(axis=0).tolist()
        raise CommandError(
            f"the point {about[0]:g},{about[1]:g} of the file is {away / 1000.0:,.1f} km from its trees: say which "
            f"point --at is the place of, such as the middle of the trees: --about {x:.1f},{y:.1f}"
        )


def only_frame(storage: Storage, collection: str) -> str:
    """The one map frame of a collection; `map` if it has none. Raises CommandError if it has several."""
    with storage.read() as tx:
        row = tx.collections.get(collection)
        frames = [] if row is None else tx.map_frames(row).in_use(_FRAMES + 1)
    if len(frames) > 1:
        names = ", ".join(frames[:_FRAMES]) + (" and others" if len(frames) > _FRAMES else "")
        raise CommandError(f"the collection has several map frames: say with --frame which one --at is in ({names})")
    return frames[0] if frames else "map"
