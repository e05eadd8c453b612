"""Typed client of Urquhart, the place-recognition database for forests.

with Client("http://127.0.0.1:8420") as client:
    result = client.query("plots", xy=seen)
    if result.verdict == "matched": ...
"""

from urquhart_client._protocol.bodies import UNSET
from urquhart_client._protocol.listings import LandmarkColumns, StoredQuery
from urquhart_client._protocol.retry import Retry
from urquhart_client.client import AsyncClient, Client
from urquhart_client.coregistrations import JobFile, PlotRow, SeasonOptions
from urquhart_client.errors import ConnectionFailed, ProblemError, UnexpectedAnswer, UrquhartError
from urquhart_client.job_models import Constraint, Job, JobLine, Progress, Snapshot
from urquhart_client.models import (
    Candidate,
    Collection,
    Explanation,
    Extent,
    Finding,
    Gates,
    Landmark,
    Limits,
    Page,
    Polygon,
    QueryResult,
    Rival,
    SessionSummary,
    Stage,
    Submap,
    SubmapReceipt,
    Tessellation,
)
from urquhart_client.poses import Inlier, InlierColumns, MapPose, SurveyPose, Transform, TreesMiddle
from urquhart_client.stand_models import Stand, StandReceipt
from urquhart_client.stem_maps import FilePlot, FileRows, FileTrees

__all__ = [
    "UNSET",
    "AsyncClient",
    "Candidate",
    "Client",
    "Collection",
    "ConnectionFailed",
    "Constraint",
    "Explanation",
    "Extent",
    "FilePlot",
    "FileRows",
    "FileTrees",
    "Finding",
    "Gates",
    "Inlier",
    "InlierColumns",
    "Job",
    "JobFile",
    "JobLine",
    "Landmark",
    "LandmarkColumns",
    "Limits",
    "MapPose",
    "Page",
    "PlotRow",
    "Polygon",
    "ProblemError",
    "Progress",
    "QueryResult",
    "Retry",
    "Rival",
    "SeasonOptions",
    "SessionSummary",
    "Snapshot",
    "Stage",
    "Stand",
    "StandReceipt",
    "StoredQuery",
    "Submap",
    "SubmapReceipt",
    "SurveyPose",
    "Tessellation",
    "Transform",
    "TreesMiddle",
    "UnexpectedAnswer",
    "UrquhartError",
]
