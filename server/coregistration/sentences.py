"""Results of plots in sentences for foresters and surveyors: what was found, and what to do about it."""

from server.coregistration.results import PlotPose, PlotResult, PossiblePlace
from server.schemas.queries import QueryAnswer
from urquhart.report.explanation import REASONS
from urquhart.verify.distortion import WARNINGS

_SHOWN = 3
"""Places that a sentence names."""


def matched_sentence(result: PlotResult) -> str:
    """Where a matched plot is, and on what that rests."""
    pose = result.pose
    assert pose is not None and result.rms is not None
    known = f"{result.inliers} of {len(result.trees)} trees are in the map, typically {result.rms:.2f} m apart"
    warned = "".join(f"; {WARNINGS[word]}" for word in result.warnings)
    return f"{pose_text(pose, is_local=result.is_local)}; {known}{warned}"


def pose_text(pose: PlotPose, *, is_local: bool) -> str:
    """Where a plot is: shift and turn about its centre, or its place and turn if its own coordinates are local."""
    side = "clockwise" if pose.turn_cw >= 0.0 else "counter-clockwise"
    e, n = pose.in_system
    turn = f"turn {abs(pose.turn_cw):.2f} deg {side}"
    if is_local:
        return f"at {e:.2f} E, {n:.2f} N, {turn}"
    if pose.shift_e is None or pose.shift_n is None:
        return (
            f"at {e:.2f} E, {n:.2f} N; its own coordinates cannot be converted to {pose.crs}, the map's "
            "system, so no shift is told: convert them with --project"
        )
    return f"shift {pose.shift_e:+.2f} m east, {pose.shift_n:+.2f} m north, {turn}"


def ambiguous_sentence(answer: QueryAnswer, places: list[PossiblePlace]) -> str:
    """Which places an ambiguous plot fits, and what would tell them apart."""
    reason = REASONS.get(answer.reason, answer.reason)
    if len(places) < 2:
        return f"{reason}: measure more trees around the plot, or their diameters"
    named = "; ".join(
        f"{e:.1f} E {n:.1f} N in {place.submap_id}, {place.trees} trees"
        for place in places[:_SHOWN]
        for e, n in (place.in_system,)
    )
    more = f"; and {len(places) - _SHOWN} more" if len(places) > _SHOWN else ""
    return (
        f"fits {len(places)} places about equally well ({named}{more}): measure more trees around the plot, or their "
        "diameters, to tell them apart"
    )


def gon_sentence(trees: int, in_gon: int, in_degrees: int) -> str:
    """That azimuths, whose unit nobody named, fit better in gon: by numbers of trees that are in the map."""
    return (
        f"the azimuths, which name no unit, fit better in gon ({in_gon} of {trees} trees instead of {in_degrees}): say "
        "--angle gon, or --angle deg to keep degrees"
    )


def skipped_sentence(rows: int) -> str:
    """That rows of a plot were left out, so that its trees there are missing."""
    which = "1 row of this plot could not be read and is" if rows == 1 else (
        f"{rows} rows of this plot could not be read and are")  # fmt: skip
    return f"{which} left out, so trees there seem to be only in the map"


def unmatched_sentence(answer: QueryAnswer) -> str:
    """Why a plot was not found, and what would make it match, if that is known."""
    why = REASONS.get(answer.reason, answer.reason)
    began = answer.search is not None and answer.search.stopped_by != "not_started"
    searched = f"; {answer.search.sentence}" if answer.search is not None and began else ""
    return f"not found: {why}{searched}{''.join(f'; hint: {hint.sentence}' for hint in answer.hints)}"
