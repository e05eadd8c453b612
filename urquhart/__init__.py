"""Place recognition in forests from tree positions alone.

The file list is the method; `recognizer` is its one page:

    landmarks, tessellation, descriptor, quads, features     what is known of one submap
    quad_table, polygon_index, segment, collection_index     what is near in a collection
    consensus, voting, matching, ransac, sweep, proposing    hypotheses
    pairing, diameters, verification                         all landmarks decide
    confidence, ranking, doubt                               chance, rivals, verdict
    explaining                                               why, in words and as a picture
    config, se2, stages, budget                              parameters, transforms, costs, deadlines
    merging                                                  submaps into one map
    simulation, evaluation, baselines, drawing               forests, scores, the paper's rivals, pictures

After Nardari et al., "Place Recognition in Forests With Urquhart Tessellations", RA-L 2020.
"""

from urquhart.budget import Abandoned, Budget
from urquhart.confidence import Gates
from urquhart.config import Config, ConfigError
from urquhart.drawing import draw_match, draw_tessellation
from urquhart.features import Features, FeaturesError, describe
from urquhart.landmarks import LandmarkError
from urquhart.ranking import Candidate, Finding, Rival, Verdict
from urquhart.recognizer import Method, Recognition, Recognizer
from urquhart.se2 import SE2
from urquhart.segment_file import SegmentDamaged
from urquhart.stages import SearchEnd, Stage
from urquhart.tessellation import Tessellation
from urquhart.warming import warm_up

__all__ = [
    "SE2",
    "Abandoned",
    "Budget",
    "Candidate",
    "Config",
    "ConfigError",
    "Features",
    "FeaturesError",
    "Finding",
    "Gates",
    "LandmarkError",
    "Method",
    "Recognition",
    "Recognizer",
    "Rival",
    "SearchEnd",
    "SegmentDamaged",
    "Stage",
    "Tessellation",
    "Verdict",
    "describe",
    "draw_match",
    "draw_tessellation",
    "warm_up",
]
