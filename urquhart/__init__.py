"""Place recognition in forests from tree positions alone.

`recognizer` is the method on one page. Each room has one purpose:

    features     one submap: landmarks, tessellation, quads, described polygons
    index        which quads and polygons of a collection are near
    propose      transforms worth verifying
    verify       one transform, judged by all landmarks
    decide       chance, rivals, verdict
    prior        a search where the caller knows roughly the pose
    report       the answer in words and as a picture
    paper        the paper's own chain, and the methods it is compared with
    mapping      several submaps made into one map
    evaluation   simulated forests, scores

A name is imported from its room when it is first used: the kernels take half a second to load, and not every command of
the service needs them.

After Nardari et al., "Place Recognition in Forests With Urquhart Tessellations", RA-L 2020.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from urquhart.budget import Abandoned, Budget
    from urquhart.config import Config, ConfigError
    from urquhart.decide.candidates import Candidate, Finding, Rival
    from urquhart.decide.confidence import Gates
    from urquhart.decide.verdict import Recognition, Verdict, unsearched
    from urquhart.features.describe import Features, FeaturesError, describe
    from urquhart.features.landmark_checks import LandmarkError
    from urquhart.features.observation import OBSTACLES, Description, describe_observation
    from urquhart.features.tessellation import Tessellation
    from urquhart.index.segment_file import SegmentDamaged
    from urquhart.options import Effort, Method, Options, SearchOptions
    from urquhart.prior.prior import Prior
    from urquhart.prior.region import WindowTooLarge
    from urquhart.recognizer import Recognizer
    from urquhart.report.match import draw_match
    from urquhart.report.motion import draw_motion
    from urquhart.report.svg import draw_tessellation
    from urquhart.se2 import SE2
    from urquhart.trace import SearchEnd, Stage
    from urquhart.warming import warm_up

__all__ = [
    "OBSTACLES",
    "SE2",
    "Abandoned",
    "Budget",
    "Candidate",
    "Config",
    "ConfigError",
    "Description",
    "Effort",
    "Features",
    "FeaturesError",
    "Finding",
    "Gates",
    "LandmarkError",
    "Method",
    "Options",
    "Prior",
    "Recognition",
    "Recognizer",
    "Rival",
    "SearchEnd",
    "SearchOptions",
    "SegmentDamaged",
    "Stage",
    "Tessellation",
    "Verdict",
    "WindowTooLarge",
    "describe",
    "describe_observation",
    "draw_match",
    "draw_motion",
    "draw_tessellation",
    "unsearched",
    "warm_up",
]

_HOMES: Final = {
    "Abandoned": "urquhart.budget",
    "Budget": "urquhart.budget",
    "Candidate": "urquhart.decide.candidates",
    "Config": "urquhart.config",
    "ConfigError": "urquhart.config",
    "Description": "urquhart.features.observation",
    "Effort": "urquhart.options",
    "Features": "urquhart.features.describe",
    "FeaturesError": "urquhart.features.describe",
    "Finding": "urquhart.decide.candidates",
    "Gates": "urquhart.decide.confidence",
    "LandmarkError": "urquhart.features.landmark_checks",
    "Method": "urquhart.options",
    "OBSTACLES": "urquhart.features.observation",
    "Options": "urquhart.options",
    "Prior": "urquhart.prior.prior",
    "Recognition": "urquhart.decide.verdict",
    "Recognizer": "urquhart.recognizer",
    "Rival": "urquhart.decide.candidates",
    "SE2": "urquhart.se2",
    "SearchEnd": "urquhart.trace",
    "SearchOptions": "urquhart.options",
    "SegmentDamaged": "urquhart.index.segment_file",
    "Stage": "urquhart.trace",
    "Tessellation": "urquhart.features.tessellation",
    "Verdict": "urquhart.decide.verdict",
    "WindowTooLarge": "urquhart.prior.region",
    "describe": "urquhart.features.describe",
    "describe_observation": "urquhart.features.observation",
    "draw_match": "urquhart.report.match",
    "draw_motion": "urquhart.report.motion",
    "draw_tessellation": "urquhart.report.svg",
    "unsearched": "urquhart.decide.verdict",
    "warm_up": "urquhart.warming",
}
"""The module of each public name."""


def __getattr__(name: str) -> Any:
    """A public name, imported from its room."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = globals()[name] = getattr(import_module(_HOMES[name]), name)
    return found


def __dir__() -> list[str]:
    """The public names, loaded or not."""
    return sorted({*globals(), *__all__})
