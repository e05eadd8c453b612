"""The hostile trials on the page, each a paragraph of what was done and what was seen."""

from collections.abc import Callable, Mapping
from typing import Final

from benchmarks.experiments import Figures
from benchmarks.markdown import number, page, prose, table


def trials_section(trials: Mapping[str, Figures]) -> str:
    """All trials that were run."""
    parts = [write(trials[name]) for name, write in _PARAGRAPHS.items() if name in trials]
    return page("## Callers that mean no good, and bad days", *parts)


def _slow(trial: Figures) -> str:
    return page(
        "### Slow callers",
        prose(
            f"""{trial["slow"]} callers that send a head, or a body, a byte a second; who is sent away comes again. An
            honest query took {_spread(trial["before"])} ms before (p50, p95, p99), {_spread(trial["during"])} ms
            meanwhile, and {_spread(trial["after"])} ms after they had gone. {number(trial["held"], 0)} of them were
            there on the average, at a cost of {number(trial["megabytes"], 1)} MB; {trial["sent_away"]} times one was
            sent away, none after more than {number(trial["longest_seconds"], 0)} s. Asked to stop afterwards the
            service took {number(trial["stop_seconds"], 1)} s."""
        ),
    )


def _spread(times: Figures) -> str:
    return ", ".join(number(times[p], 1) for p in ("p50", "p95", "p99"))


def _bodies(trial: Figures) -> str:
    rows = [
        [
            one["body"],
            ", ".join(map(str, one["statuses"])),
            f"{one['bytes'] / 1e6:,.2f}",
            number(one["seconds"], 2),
            number(one["others_waited"], 2),
        ]
        for one in trial["bodies"]
    ]
    return page(
        "### Bodies",
        prose(
            f"""Each to every route that takes a body; the worst of them. While a body is read, others who ask for
            nothing (`/livez`) wait as long as the last column says. The service had {number(trial["megabytes"], 0)} MB
            more at the end."""
        ),
        table(["body", "answers", "MB sent", "answered within, s", "others waited, s"], rows, words=2),
    )


def _names(trial: Figures) -> str:
    return page(
        "### Names",
        prose(
            f"""{trial["good"]} ids of many scripts, from right to left, as long as may be: each made, stored under,
            listed, found, left out of a search. {trial["bad"]} that are none (decomposed, emoji, marks that cannot be
            seen, slashes, broken percent-encoding): each refused."""
        ),
    )


def _crowd(trial: Figures) -> str:
    return page(
        "### Many collections",
        prose(
            f"""{trial["collections"]:,} collections, a hundred of them with a submap: made in
            {number(trial["made_seconds"], 0)} s, a start takes {number(trial["ready_seconds"], 1)} s, and
            {number(trial["ready_again_seconds"], 1)} s the next time; {number(trial["megabytes_at_start"], 0)} MB after
            it, {number(trial["megabytes_after"], 0)} MB after all this. All are listed in
            {number(trial["list_seconds"], 1)} s, no page in more than {number(trial["slowest_page_seconds"], 2)} s. A
            first query takes {number(trial["first_query_milliseconds"], 0)} ms, another collection
            {number(trial["one_more_milliseconds"], 0)} ms. With nothing to do the service
            keeps {number(trial["idle_cores"], 2)} cores busy. `/metrics` has {trial["metrics_bytes"] / 1e6:,.1f} MB."""
        ),
    )


def _clock(trial: Figures) -> str:
    return page(
        "### A clock that is set",
        prose(
            f"""The wall clock of a running service was set {trial["jumps"]} times, by up to 20 years ahead and three
            back. After each: stored, replaced, deleted, found; revisions counted; listed in the order of arrival; a
            POST repeated with its Idempotency-Key. The service looks at the wall clock in
            {", ".join(f"`{name}`" for name in trial["looks"])}. What it decides by it: whether an API key has expired,
            whether the answer to a POST is still kept, whether a file that nobody lists is a minute old. Everything
            else (revisions, the order of listings, back-off, waiting) is counted, or measured by a clock that is never
            set. Set ahead, kept answers are forgotten early; set back, leftover files stay until it has caught up."""
        ),
    )


def _kills(trial: Figures) -> str:
    jobs = trial["jobs"]
    ended = "" if jobs is None else ", ".join(f"{count} {how}" for how, count in sorted(jobs["ended"].items()))
    return page(
        "### Killed at work",
        prose(
            f"""{trial["rounds"]} rounds of four writers, each cut short by SIGKILL or SIGTERM in turn:
            {trial["acknowledged"]:,} writes acknowledged, {trial["cut_short"]} requests cut short. Afterwards each
            acknowledged one had to be there and be found, and each POST, sent again with its key, done once. Asked to
            stop, it took at most {number(trial["stop_seconds"], 1)} s."""
        ),
        prose(
            "Jobs were not part of it: the service had none."
            if jobs is None
            else f"""Beside them imports of {jobs["lines"]:,} lines, and reindexing: {jobs["interrupted"]} were under
            way when the service was ended. How all ended: {ended}. Each import had to leave a result for each line
            in its order, with the outcome that the line deserves, and what it stored had to be found."""
        ),
    )


def _disk(trial: Figures) -> str:
    if "skipped" in trial:
        return page("### A full disk", prose(f"Not run: {trial['skipped']}."))
    others = [
        f"{what.replace('_', ' ')}: {trial[what]}"
        for what in ("import_full", "snapshot_full", "import_after", "snapshot_after")
        if what in trial
    ]
    started = "was ready and answered" if trial["started_on_a_full_disk"] else "did not start"
    return page(
        "### A full disk",
        prose(
            f"""A disk of {trial["megabytes"]} MB, filled until a PUT was refused with 507: {trial["stored"]:,} submaps
            were acknowledged, and are all there. {"; ".join(others)}{"." if others else ""} Killed and started again
            on the full disk, the service {started}; with room again it stores."""
        ),
    )


_PARAGRAPHS: Final[dict[str, Callable[[Figures], str]]] = {
    "slow": _slow,
    "bodies": _bodies,
    "names": _names,
    "crowd": _crowd,
    "clock": _clock,
    "kills": _kills,
    "disk": _disk,
}
