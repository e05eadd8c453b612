"""An answer to `urquhart locate` as text: where the trees are, which have partners, or why nothing was found."""

from rich.console import Console
from rich.table import Table

from server.commands.support.pose_text import pose_lines
from server.coregistration.outputs.diameters import diameter_unit
from server.coregistration.results import PlotResult
from server.coregistration.sentences import pose_text
from server.schemas.queries import QueryAnswer
from urquhart.report.explanation import sentence as reason_sentence
from urquhart.verify.distortion import WARNINGS


def print_answer(console: Console, answer: QueryAnswer, placed: PlotResult | None) -> None:
    """Print an answer; `placed`: the same, against all trees of the map there, unless nothing can be said of that."""
    console.print(f"[bold]{answer.verdict}[/bold] ({answer.reason}), {answer.landmark_count} trees", highlight=False)
    for line in answer_lines(answer, placed):
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    if answer.candidates:
        console.print(_table(answer))
    for line in low_confidence_lines(answer):
        console.print(line, highlight=False, markup=False, soft_wrap=True)


def answer_lines(answer: QueryAnswer, placed: PlotResult | None) -> list[str]:
    """What is told of an answer, line by line."""
    lines: list[str] = []
    best = answer.candidates[0] if answer.candidates else None
    if answer.verdict == "matched" and best is not None:
        lines += pose_lines(best)
        lines += _converted_lines(placed)
        lines += _found_lines(answer, placed)
        lines += [] if placed is None else diameter_unit(placed)
    warned = best.warnings if answer.verdict == "matched" and best is not None else []
    lines += [f"warning: {WARNINGS[word]} ({word})" for word in (*answer.warnings, *warned)]
    if answer.verdict == "no_match" and answer.search is not None:
        began = answer.search.stopped_by != "not_started"
        effort = "" if answer.search.stopped_by == "window" else f"effort {answer.effort}: "
        lines.append(f"{effort}{answer.search.sentence}" if began else reason_sentence(answer.reason))
    lines += [f"hint: {hint.sentence}" for hint in answer.hints]
    if answer.verdict != "matched" and placed is not None:
        lines.append(placed.sentence)
        lines += [
            f"possible place: {e:.3f} E, {n:.3f} N in {one.frame_id} ({one.submap_id}), turn {one.turn_cw:.2f} "
            f"deg clockwise, {one.trees} trees"
            for one in placed.places
            for e, n in (one.in_system,)
        ]
    return lines


def _converted_lines(placed: PlotResult | None) -> list[str]:
    """Shift and turn after a conversion between two systems, whose axes differ; nothing if the file is in the map's."""
    if placed is None or placed.pose is None or None in (placed.system, placed.pose.crs):
        return []
    if placed.system == placed.pose.crs or placed.is_local:
        return []
    told = pose_text(placed.pose, is_local=False)
    return [
        f"converted from {placed.system} to {placed.pose.crs}: {told}. The shift and turn above are from the file's "
        "own coordinates, so they contain the difference of the two systems"
    ]


def _found_lines(answer: QueryAnswer, placed: PlotResult | None) -> list[str]:
    """How many trees are on both sides, and how many on one only."""
    best = answer.candidates[0]
    if placed is None or placed.pose is None or placed.rms is None:
        return [f"inliers: {best.inlier_count} of {answer.landmark_count} trees, rms {best.rms:.3f} m"]
    only_map = sum(one.inside and not one.paired for one in placed.map_trees)
    only_plot = len(placed.trees) - placed.inliers
    return [
        f"inliers: {placed.inliers} of {answer.landmark_count} trees are in the map, rms {placed.rms:.3f} m; "
        f"{only_plot} are not (ingrowth, or missed by the map), and {only_map} trees of the map are not in "
        f"{placed.name} (felled, or missed)"
    ]


def low_confidence_lines(answer: QueryAnswer) -> list[str]:
    """Why the confidence of the best candidate is low although its log odds are high, if so."""
    if not answer.candidates:
        return []
    best = answer.candidates[0]
    if best.refused is None or best.log_odds < answer.gates.log_odds:
        return []
    return [
        f"log odds of {best.log_odds:.1f} say that chance hardly explains this many trees. The confidence is "
        f"{best.confidence:.3f} all the same, because {reason_sentence(best.refused)}."
    ]


def _table(answer: QueryAnswer) -> Table:
    """The candidates, a row each."""
    table = Table(box=None)
    table.add_column("rank", justify="right")
    table.add_column("submap", no_wrap=True)  # never cut short: it is the answer
    for name in ("inliers", "ratio", "rms m", "overlap", "support", "level", "log odds", "confidence"):
        table.add_column(name, justify="right")
    table.add_column("refused")
    for one in answer.candidates:
        table.add_row(
            str(one.rank),
            one.submap_id,
            str(one.inlier_count),
            f"{one.inlier_ratio:.2f}",
            f"{one.rms:.3f}",
            f"{one.overlap_ratio:.2f}",
            str(one.support),
            one.level,
            f"{one.log_odds:.1f}",
            f"{one.confidence:.3f}",
            one.refused or "",
        )
    return table
