"""The demo from end to end."""

import statistics
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np
from rich.console import Console
from rich.table import Table

import urquhart
from server.commands.demo.observations import (
    HARD,
    RIGHT_DEGREES,
    RIGHT_METRES,
    DemoQuestion,
    DemoStand,
    JudgedAnswer,
    ask,
    judge,
)
from server.commands.demo.service import running_service
from server.commands.index import ensure_collection, sentence
from server.commands.support.failure import CommandError
from server.commands.support.progress import ProgressReport
from server.config.settings import Limits
from server.observability.kernel_progress import warm_up
from server.stem_maps.reader import StemMap, read_stem_map
from server.stem_maps.stands import cut_stand, store_stand
from server.store.sqlite.database import Database
from server.store.sqlite.upgrade.migrations_runner import upgrade
from server.submaps.bulk_ingest import LineOptions
from urquhart_client import Candidate, Client, QueryResult

COLLECTION: Final = "forests"
STANDS: Final = (
    DemoStand("lansing", sensor_range=30.0, radius=30.0, spacing=20.0),
    DemoStand("bei", sensor_range=50.0, radius=50.0, spacing=30.0),
)
FOREIGN: Final = DemoStand("longleaf", sensor_range=40.0)
FOREIGN_OBSERVATIONS: Final = 10
HARD_OBSERVATIONS: Final = 10
SHARE_RIGHT: Final = 0.95
OUTPUT: Final = (
    "urquhart.db",
    "urquhart.db-wal",
    "urquhart.db-shm",
    "server.log",
    "match.svg",
    "moving.svg",
    "tessellation.svg",
    "hard.svg",
)


def run(out: Path, data: Path, *, seed: int, observations: int, keep: bool) -> bool:
    """Run the demo. Returns whether at least 95 % of the answers are right and none is wrong.

    Args:
        out: directory for the database, the drawings and the log; made when it is not there.
        data: directory with the stem maps.
        observations: how many places in the database to ask about.
        keep: leave the service running.

    Raises:
        Failure, StemMapError, DomainError: with a line that says what to do.
    """
    console = Console()
    stem_maps = _read(data)
    _clear(out)
    rng = np.random.default_rng(seed)
    asked = [STANDS[i % 2] for i in range(observations)] + [FOREIGN] * FOREIGN_OBSERVATIONS
    questions = [ask(stand, stem_maps[stand.name], rng) for stand in asked]

    warm_up(partial(console.print, highlight=False))()
    _store(out / OUTPUT[0], stem_maps, console)
    console.print("starting the service", highlight=False)
    with running_service(out / OUTPUT[0], out / "server.log", keep=keep) as (url, pid):
        console.print(f"service ready on {url}", highlight=False)
        with Client(url) as client:
            answers = _ask_all(client, questions, seed, console)
            console.print(_table(answers))
            passed = _summary(answers, console)
            drawings = _draw(client, answers, out)
            hard = [ask(STANDS[0], stem_maps[STANDS[0].name], rng, HARD) for _ in range(HARD_OBSERVATIONS)]
            more, hardest = _compare(client, hard, seed, out, console)
            drawings += more
    for path in drawings:
        console.print(f"drawn: {path}", highlight=False, soft_wrap=True)
    if keep:
        console.print(f"still serving on {url} ; stop it with: kill {pid}", highlight=False)
        if hardest is not None:
            page = f"{url}/ui/collections/{COLLECTION}/queries/{hardest}"
            console.print(f"the hardest of these matches, in a browser: {page}", highlight=False, soft_wrap=True)
    return passed


def _read(data: Path) -> dict[str, StemMap]:
    names = [stand.name for stand in (*STANDS, FOREIGN)]
    if not data.is_dir():
        raise CommandError(
            f"{data}: no such directory. The stem maps are in the source repository (data/stem_maps), not in the "
            "installed package: give their directory with --data"
        )
    return {name: read_stem_map(data / f"{name}.csv") for name in names}


def _clear(out: Path) -> None:
    # Only what the demo itself wrote, because the folder may be used for other things as well.
    out.mkdir(parents=True, exist_ok=True)
    for name in OUTPUT:
        (out / name).unlink(missing_ok=True)


def _store(path: Path, stem_maps: dict[str, StemMap], console: Console) -> None:
    limits = Limits()  # the defaults, so that the caller's environment cannot change the demo
    database = Database(path)
    try:
        upgrade(database)
        ensure_collection(database, COLLECTION)
        with ProgressReport(console, "submaps") as progress:
            for stand in STANDS:
                if stand.radius is None or stand.spacing is None:
                    continue
                stem_map = stem_maps[stand.name]
                cut = cut_stand(stem_map, stand.radius, stand.spacing, limits)
                advance = progress.task(stand.name, len(cut.discs))
                report = store_stand(
                    database,
                    COLLECTION,
                    stem_map,
                    cut,
                    LineOptions(limits=limits),
                    advance=advance,
                )
                console.print(sentence(report), highlight=False, soft_wrap=True)
    finally:
        database.dispose()


def _ask_all(client: Client, questions: Sequence[DemoQuestion], seed: int, console: Console) -> list[JudgedAnswer]:
    answers = []
    with ProgressReport(console, "queries") as progress:
        advance = progress.task("asking", len(questions))
        for question in questions:
            began = time.perf_counter()
            result = client.query(COLLECTION, question.xy, seed=seed)
            answers.append(judge(question, result, 1000.0 * (time.perf_counter() - began)))
            advance(1)
    return answers


def _draw(client: Client, answers: Sequence[JudgedAnswer], out: Path) -> list[Path]:
    """Drawings of the first right match of the first stand, and of the tessellation of its submap."""
    for answer in answers:
        best = answer.result.best
        if answer.right and best is not None:
            stored = client.query(COLLECTION, answer.question.xy, store=True)
            if stored.id is None or stored.best is None:
                raise CommandError("the service did not keep a query that it was asked to keep")
            match, tessellation = out / "match.svg", out / "tessellation.svg"
            match.write_text(client.match_svg(COLLECTION, stored.id, stored.best.rank), encoding="utf-8")
            tessellation.write_text(client.tessellation_svg(COLLECTION, stored.best.submap_id), encoding="utf-8")
            return [match, tessellation, _draw_motion(client, answer, stored.best, out)]
    return []


def _draw_motion(client: Client, answer: JudgedAnswer, found: Candidate, out: Path) -> Path:
    """A drawing of the observation as it turns and slides into the submap that it was found in."""
    trees = client.get_submap(COLLECTION, found.submap_id).landmarks or ()
    position = {tree.id: at for at, tree in enumerate(trees)}
    drawing = urquhart.draw_motion(
        answer.question.xy,
        [(tree.x, tree.y) for tree in trees],
        urquhart.SE2(found.transform.x, found.transform.y, found.transform.yaw),
        [(int(pair.query), position[pair.submap]) for pair in found.inliers],
        title="Where is this?",
    )
    path = out / "moving.svg"
    path.write_text(drawing, encoding="utf-8")
    return path


def _compare(
    client: Client, hard: Sequence[DemoQuestion], seed: int, out: Path, console: Console
) -> tuple[list[Path], str | None]:
    """Send hard queries with the paper's method and the default one, and draw the explanation of one that only the
    default answers. Returns the drawing, and the id of the right answer that was nearest to being refused.
    """
    lost: list[QueryResult] = []
    right_ones: list[tuple[float, str]] = []
    found: dict[urquhart.Method, int] = {"paper": 0, "robust": 0}
    for question in hard:
        answers = {name: client.query(COLLECTION, question.xy, method=name, seed=seed, store=True) for name in found}
        right = {name: judge(question, answer, 0.0).right for name, answer in answers.items()}
        found = {name: count + right[name] for name, count in found.items()}
        best = answers["robust"].best
        if right["robust"] and best is not None and answers["robust"].id is not None:
            right_ones.append((best.log_odds, answers["robust"].id))
        if right["robust"] and not right["paper"]:
            lost.append(answers["robust"])
    console.print(
        f"the same at {HARD.sigma[0]:g} m and {HARD.detection[1]:.0%} seen: {found['robust']} of {len(hard)} right; by "
        f"the paper's method {found['paper']}",
        highlight=False,
        soft_wrap=True,
    )
    hardest = min(right_ones)[1] if right_ones else None
    if not lost or lost[0].id is None:
        return [], hardest
    path = out / "hard.svg"
    path.write_text(client.explanation_svg(COLLECTION, lost[0].id), encoding="utf-8")
    return [path], hardest


def _table(answers: Sequence[JudgedAnswer]) -> Table:
    table = Table(title="What the service says about each observation")
    for name in ("forest", "trees", "verdict", "error m", "error °", "inliers", "ms"):
        table.add_column(name, justify="left" if name in ("forest", "verdict") else "right", no_wrap=True)
    for answer in answers:
        candidates = answer.result.candidates
        best = candidates[0] if candidates else None
        known = answer.question.stand.radius is not None
        table.add_row(
            answer.question.stand.name + ("" if known else " (unknown)"),
            str(len(answer.question.xy)),
            answer.result.verdict,
            "" if answer.metres is None else f"{answer.metres:.3f}",
            "" if answer.degrees is None else f"{answer.degrees:.3f}",
            "" if best is None else str(best.inlier_count),
            f"{answer.milliseconds:.1f}",
            style="bold red" if answer.wrong else "" if answer.right else "yellow",
        )
    return table


def _summary(answers: Sequence[JudgedAnswer], console: Console) -> bool:
    known = [answer for answer in answers if answer.question.stand.radius is not None]
    foreign = [answer for answer in answers if answer.question.stand.radius is None]
    right = sum(answer.right for answer in known)
    wrong = sum(answer.wrong for answer in known)
    false = sum(answer.wrong for answer in foreign)
    metres = [answer.metres for answer in known if answer.right and answer.metres is not None]
    console.print(
        f"in the database: {right} of {len(known)} matched and right (within {RIGHT_METRES:g} m and {RIGHT_DEGREES:g} "
        f"degrees), {wrong} matched wrongly, {len(known) - right - wrong} undecided"
        + (f"; median error {statistics.median(metres):.3f} m" if metres else ""),
        highlight=False,
        soft_wrap=True,
    )
    console.print(
        f"unknown forest: {len(foreign) - false} of {len(foreign)} not matched, {false} false", highlight=False
    )
    times = sorted(answer.milliseconds for answer in answers)
    console.print(
        f"time of a query over HTTP: median {statistics.median(times):.1f} ms, longest {times[-1]:.1f} ms",
        highlight=False,
        soft_wrap=True,
    )
    return wrong == 0 and false == 0 and right >= SHARE_RIGHT * len(known)
