"""docs/maps.md, written from the figures beside it."""

from typing import Any, Final

from benchmarks.experiments import provenance
from benchmarks.maps.graphs import LANE, LOOP, REACH, SPACING, TOGETHER
from benchmarks.maps.matching import WRONG as OFF
from benchmarks.maps.odometry import SUBMAPS
from benchmarks.maps.robots import DRIFT, WRONG
from benchmarks.maps.sequences import STEP, VIEWS
from benchmarks.maps.stands import SENSOR
from benchmarks.markdown import number, page, picture, prose, table

Figures = dict[str, Any]
GUIDE: Final = """# Maps: many drives, one stem map

A map is made from submaps and the constraints between them: matches that the search finds, odometry, priors. Each
submap gets a pose in one frame, and each tree one entry.

    urquhart map build drives --session monday --session tuesday --trees site.gpkg --apply

or over HTTP: `POST /v1/collections/drives/maps` starts a job, `GET .../maps/{id}` has the poses, and
`GET .../maps/{id}/landmarks?format=gpkg` the trees. `examples/drives_to_map.py` is a whole example in 30 lines. Maps
need GTSAM: `pip install 'urquhart[maps]'` (Linux and macOS).

- **False loops are left out.** Matches that close short cycles confirm each other and form groups. Groups are added
  one after the other, the largest first, as long as they agree with what is there. Each constraint that is left out is
  named with the reason: `contradicted` by others, or `unconfirmed` by any.
- **Plantations without odometry.** In rows of trees, most submaps fit most others many rows off. So each match counts
  only if it clearly leads every other pose in the same submap, and takes about 40 ms to compare there. In 25 simulated
  drives through rows 3 m apart with 0.3 m of jitter, of 35 submaps each, none of the 1,968 matches left was false, and
  no map was folded (before, 3,266 of 5,278 were false, and 12 maps folded). The largest part had 33 of the 35 submaps
  on average: others are frames of their own. With 0.15 m of jitter hardly any submap matches, and nearly each stays a
  frame of its own. Post odometry, or priors, to place such submaps.
- **Constraints are kept.** Matches and posted odometry (`POST .../odometry`) stay in the collection, each with its
  state. The next map looks up only submaps that are new or have other landmarks. `GET .../constraints?format=g2o` (or
  TUM, KITTI, matrices, JSON) and `urquhart map constraints` write them for other programs.
- **Odometry is a measurement.** It is believed within its covariance, and worth more than a match. But an edge is
  refused if several independent ways through other constraints agree against it, or if the map keeps many more matches
  without it. Where odometry contradicts only itself, the edge with most against it is refused, or all of them if these
  are even. Each contradiction is listed in `contradictions`, with both sides and how many standard deviations they are
  apart. If nothing tells which side is wrong (`undecided`), the poses are not applied.
- **Nothing is guessed.** Parts that no constraint connects stay frames of their own, each in a map frame and a file of
  its own. A single match joins two parts only if at least 99 % of the matches that can be checked are right,
  and if no other single match contradicts it: then the one that is false is left out if all others agree without it,
  and else the parts stay apart. A false match that nothing contradicts cannot be told from a right one.
- **Applying is one transaction.** All poses are written under one new revision of the collection, or none: if a submap
  got other landmarks meanwhile, or if other submaps are in the map frame and would no longer fit.
- **Frames are merged.** `POST .../merges {from, to}` and `urquhart map merge` lay one map frame onto another: the
  largest set of matches that agree gives the pose, if 4 of them have no submap in common, and it is twice as large as
  any other set. All
  other matches are named with reasons.
- **A robot asks where it is while it drives.** `GET .../sessions/{session}/poses` has the pose of each submap of a
  session now, with its covariance, and what became of each constraint. New odometry and matches are taken in at once.
  What only a search of all constraints can judge is `pending` until that has run in the background; `settled` says
  whether anything is. Nothing is stored: a restart, or another process, gives the same poses from the same rows.
- **Trees.** Two trees of one submap never become one. The position has a covariance, diameter and height are medians,
  and `missed` counts the submaps that have other trees all around this one.
- **Do not use applied poses as priors.** They follow from the same matches and would count twice."""


def report(results: dict[str, Figures]) -> str:
    """The page."""
    parts = [GUIDE]
    if "maps_graphs" in results:
        parts.append(_graphs(results["maps_graphs"]))
    if "maps_odometry" in results:
        parts.append(_odometry(results["maps_odometry"]))
    if "maps_online" in results:
        parts.append(_online(results["maps_online"]))
    if "maps_robots" in results:
        parts.append(_robots(results["maps_robots"]))
    if "maps_sequences" in results:
        parts.append(_sequences(results["maps_sequences"]))
    if "maps_stands" in results:
        parts.append(_stands(results["maps_stands"]))
    if "maps_tracks" in results:
        parts.append(_tracks(results["maps_tracks"]))
    return page(*parts, "## Where these figures come from", provenance(results))


def _graphs(figures: Figures) -> str:
    head = ["submaps", "drift", "false", "groups", "drives", "false kept", "right refused", "by odometry, m", "map, m"]
    rows = [
        [
            str(row["submaps"]),
            f"{100 * row['drift']:.0f} %",
            f"{100 * row['share']:.0f} %",
            "yes" if row["grouped"] else "",
            str(row["drives"]),
            f"{row['false_kept']:.0f} of {row['false']:.0f}",
            f"{row['right_refused']:.0f} of {row['loops'] - row['false']:.0f}",
            number(row["before"]),
            f"{number(row['after'])} ({number(row['worst'])})",
            number(row["nees"]),
            number(row["seconds"], 1),
        ]
        for row in figures["rows"]
    ]
    return page(
        "## Drift and false loops",
        picture("maps_drive", "A drive by odometry and as a map, with the false loops that were left out"),
        prose(
            f"""Simulated pose graphs: lanes {LANE:g} m apart, a submap each {SPACING:g} m, matches within {REACH:g} m
            that are off by {100 * LOOP[0]:g} cm. *Drift* is the error of each step of odometry as a share of its
            length. False matches join random submaps at random poses; in groups, {TOGETHER} neighbours agree on one
            wrong place. The error is the mean distance of submaps from their true positions, in the frame of the first
            one; in brackets that of the worst drive. The last columns are the NEES of the poses (3 if covariances are
            honest) and the seconds to optimise."""
        ),
        table([*head, "NEES", "s"], rows, words=0),
    )


def _odometry(figures: Figures) -> str:
    rows = [
        [
            row["lie"] or "is right",
            f"{100 * row['share']:.0f} %" + (" in groups" if row["grouped"] else ""),
            f"{row['drives']}",
            f"{row['refused']:.0f} + {row['said']:.0f}" if row["lie"] else "",
            f"{row['right_odometry']:.0f}",
            f"{row['doubted']:.0f}",
            f"{row['false_kept']:.0f} of {row['false']:.0f}",
            f"{row['right_refused']:.0f} of {row['right']:.0f}",
            number(row["error"]),
        ]
        for row in figures["rows"]
    ]
    head = ["one step", "false loops", "drives", "refused + named", "right odometry refused", "undecided", "false kept"]
    return page(
        "## Odometry that lies",
        prose(
            f"""The same drives of {SUBMAPS} submaps with 1, 3 and 5 % drift, but one random step of odometry slips or
            turns while its covariance stays as it is. *Refused* counts drives in which exactly this step was left out,
            *named* those in which it was only named as one side of a contradiction. *Undecided* counts contradictions
            of which nothing tells which side is wrong; such a map is not applied."""
        ),
        table([*head, "right matches refused", "error, m"], rows, words=2),
    )


def _online(figures: Figures) -> str:
    rows = [
        [
            f"{row['submaps']}",
            f"{100 * row['drift']:.0f} %",
            f"{100 * row['share']:.0f} %" + (" in groups" if row["grouped"] else ""),
            f"{row['drives']}",
            f"{row['false_used']:.0f} of {row['false']:.0f}",
            f"{row['right_unused']:.0f} of {row['loops'] - row['false']:.0f}",
            f"{row['searches'] / row['drives']:.1f}",
            f"{1000 * row['median']:.0f}, {1000 * row['p95']:.0f}, {1000 * row['worst']:.0f}",
            number(row["apart"], 3),
            number(row["error"]),
        ]
        for row in figures["rows"]
    ]
    first, second = (row for k, row in enumerate(figures["rows"]) if k in (0, len(figures["rows"]) - 1))
    head = ["submaps", "drift", "false loops", "drives", "false used", "right unused", "searches"]
    return page(
        "## Poses of a drive that goes on",
        prose(
            f"""The same drives, of which the last {first["coming"]} submaps ({second["coming"]} of
            {second["submaps"]}) come one by one, each with its odometry and its matches, as in
            `GET .../sessions/{{session}}/poses`. *Searches* of all constraints ran when they were due, which the
            service does in the background. Then the milliseconds to take in a submap: median, 95 %, and the longest;
            other programs shared the core while these were measured.
            *Apart*: the largest distance of a submap from where a search of all constraints has it, in metres."""
        ),
        table([*head, "ms", "apart, m", "error, m"], rows, words=0),
    )


def _robots(figures: Figures) -> str:
    rows = [
        [
            f"{row['robots']} with {row['submaps']} submaps",
            f"{100 * row['share']:.0f} %" + (" in groups" if row["grouped"] else ""),
            f"{row['right']:.0f} of {row['drives']}",
            f"{row['mapped']:.0f} of {row['drives'] - row['right']:.0f}" if "mapped" in row else "",
            f"{row['apart']:.0f}",
            f"{row['wrong']:.0f}",
            number(row["error"]),
        ]
        for row in figures["rows"]
    ]
    head = ["robots", "false matches", "right", "others right in one map"]
    return page(
        "## Robots that meet",
        prose(
            f"""The same drives with {100 * DRIFT:g} % drift, cut into one piece for each robot. Each robot makes a map
            in a frame of its own. Then frames are laid onto each other (`POST .../merges`), those with most matches
            that agree first. A drive is right if all robots are in one frame, and the submaps of each are less than
            {WRONG:g} m from their true positions on average, in the frame of the first submap. A frame that is laid
            onto another stays rigid, so the drift of each robot's own map stays in it, and adds up from frame to frame.
            That is the cause of the others: in six of them, robots were 0.5 to 2.3 standard deviations off. If all
            submaps become one map (`POST .../maps` of all sessions, after merges or without), the matches correct that
            drift: *others right in one map*."""
        ),
        table([*head, "not all in one frame", "robots off", "error, m"], rows),
    )


def _sequences(figures: Figures) -> str:
    rows = [
        [
            row["stand"] if row["inside"] else f"another one: {row['stand']}",
            f"{row['radius']:g} m",
            f"{row['count']}",
            *(f"{row[f'right {views}']:.0f}, {row[f'ambiguous {views}']:.0f}" for views in VIEWS),
            f"{sum(row[f'wrong {views}'] for views in VIEWS):.0f}",
        ]
        for row in figures["rows"]
    ]
    head = ["stand", "seen to", "sequences", *(f"{views} view{'s' * (views > 1)}" for views in VIEWS), "wrong"]
    return page(
        "## Several views as one query",
        prose(
            f"""A robot sees little (10 cm of noise, 90 % of the trees) and sends keyframes {STEP:g} m apart with its
            odometry, which is off by 10 cm and 0.9 degrees each step. The first of two numbers is how many sequences
            are matched, rightly; the second how many are ambiguous. In rows marked *another one*, the robot is in
            another stand of the same kind, which is not stored."""
        ),
        table(head, rows),
    )


def _stands(figures: Figures) -> str:
    rows = [
        [
            name,
            f"{row['drives']:.0f}",
            f"{row['false']:.0f} of {row['matches']:.0f}",
            f"{row['false_kept']:.0f}",
            f"{row['folded']:.0f}",
            f"{row['largest']:.0f} of {row['submaps']:.0f}",
            f"{number(row['error'])} ({number(row['worst'])})",
            f"{row['doubled']:.0f}, {row['lost']:.0f}, {row['mixed']:.0f} of {row['trees']:.0f}",
        ]
        for name, row in figures["stands"].items()
    ]
    head = ["stand", "drives", "false matches", "false kept", "folded", "in the largest part", "error, m"]
    return page(
        "## Forests and plantations, without odometry",
        prose(
            f"""Lanes through a simulated stand, seen to {SENSOR.radius:g} m with {100 * SENSOR.sigma:g} cm of noise and
            {100 * SENSOR.detection:g} % of the trees, matched by the search itself, and nothing but these matches. A
            match is false if it is off by more than {OFF[0]:g} m. A map is folded if it keeps a false match. The
            last column has trees with two entries, trees without one, and entries with landmarks of two trees."""
        ),
        table([*head, "doubled, lost, mixed trees"], rows),
    )


def _tracks(figures: Figures) -> str:
    rows = [
        [
            row["map"],
            row["level"],
            f"{row['right']:.0f} of {row['steps']:.0f}",
            f"{number(row['errors'], 3)} ({number(row['reference'], 3)})",
            f"{row['false_kept']:.0f} of {row['false']:.0f}",
            f"{row['doubled']:.0f}, {row['lost']:.0f}, {row['mixed']:.0f}",
            f"{row['dbscan_doubled']:.0f}, {row['dbscan_mixed']:.0f}",
            f"{row['trees']:.0f}",
        ]
        for row in figures["tracks"]
    ]
    head = ["map", "noise, seen", "steps right", "mean (true pairs), m", "false kept", "doubled, lost, mixed"]
    missing = [f"Not run: {name} ({reason})." for name, reason in figures["missing"].items()]
    return page(
        "## Table II: tracks through real stem maps",
        prose(
            """The tracks of [Table II](results.md#table-ii-map-merging-on-real-stem-maps): the same submaps, with their
            noise and drift, but all matched with each other and optimised together. Errors are the distances of true
            pairs in submaps in a row; in brackets what these pairs themselves give. Then trees with two entries,
            without one, and entries of two trees; beside them, the first and the last of these with the paper's DBSCAN
            under the same poses."""
        ),
        table([*head, "DBSCAN", "trees"], rows, words=2),
        *missing,
    )
