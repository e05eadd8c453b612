"""Explanations of answers, as tables for a terminal."""

from rich import box
from rich.console import Console
from rich.table import Table

from server.schemas.queries import QueryAnswer
from urquhart import Stage
from urquhart.report.explanation import counted, sentence


def print_explanation(console: Console, answer: QueryAnswer) -> None:
    """Print the reason in words, the time and counts of each stage, and what each level found in each submap."""
    gates = answer.gates
    console.print(f"why: {sentence(answer.reason)}", highlight=False)
    if answer.lead is not None:
        console.print(
            f"lead over the best other pose: {answer.lead:.1f}; asked are {gates.lead:.1f}, "
            f"{gates.lead_per_landmark:g} more for each tree of the overlap, and {gates.lead_ratio:.0%} of the "
            "other's evidence",
            highlight=False,
            soft_wrap=True,
        )
    console.print(_stages(answer))
    if not answer.findings:
        return
    console.print(_findings(answer))
    if answer.findings_total is not None and answer.findings_total > len(answer.findings):
        console.print(f"the strongest {len(answer.findings)} of {answer.findings_total} findings", highlight=False)


def _stages(answer: QueryAnswer) -> Table:
    table = _table("what each stage took and counted")
    table.add_column("stage", no_wrap=True)
    table.add_column("ms", justify="right")
    table.add_column("counted")
    for stage in answer.stages:
        counts = counted(Stage(stage.name, stage.milliseconds, stage.counts))
        table.add_row(stage.name, f"{stage.milliseconds:.2f}", counts)
    return table


def _findings(answer: QueryAnswer) -> Table:
    gates = answer.gates
    table = _table(f"what each level found, before rivals were looked for; gate: log-odds {gates.log_odds:.1f}")
    table.add_column("level", no_wrap=True)
    table.add_column("submap", overflow="fold")
    for name in ("support", "inliers", "log-odds", "each"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("so")
    for one in answer.findings or ():
        table.add_row(
            one.level,
            one.submap_id,
            str(one.support),
            f"{one.inlier_count}/{one.overlap_count}",
            f"{one.log_odds:.1f}",
            f"{one.evidence / max(one.overlap_count, 1):.2f}",
            sentence(one.refused),
        )
    return table


def _table(title: str) -> Table:
    return Table(title=title, title_justify="left", title_style="", box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1))
