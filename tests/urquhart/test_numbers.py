"""Every tuning number has a home, a sentence and a source."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import urquhart

ROOT: Final = Path(urquhart.__file__).parent
SOURCE: Final = re.compile(r"[Cc]hosen by hand|[Mm]easured|[Ff]ollows from|\(paper, section|[Ff]itted")

FIXED: Final = {
    # How files and packed words are laid out: other values are another format.
    *("config.DESCRIPTION_VERSION", "config.FEATURES_FORMAT", "features.describe.HEAD", "index.segment.FORMAT"),
    *("index.segment._UNIT", "index.segment._MOST_UNITS", "index.segment_file._ALIGNED", "index.segment_file._HEADER"),
    *("index.quad_table.STEPS", "index.quad_table.SIDE", "index.quad_table._BITS", "index.quad_table.TURNS"),
    *(
        "index.quad_table.HALF",
        "index.quad_table._NEAR",
        "index.quad_table.MOST_SLOTS",
        "index.quad_hits.MOST_SEARCHED",
    ),
    *("index.polygon_scan._ROW_BITS", "index.quad_hits.SECTORS"),
    *("propose.correlation._FINE", "propose.correlation._LOOK", "paper.glarot._UNIT", "index.polygon_merge._SEED"),
    # What is read, kept or looked at together: time and memory, never an answer.
    *("index.segment_file._AT_ONCE", "index.segment_file._SMALL", "index.polygon_scan._BLOCK"),
    *(
        "verify.cell_sorting.CROWD",
        "prior.superposition.AT_ONCE",
        "prior.window._STEPS",
        "mapping.graph_solver._SOLVED",
    ),
    *("propose.hit_buffer._FIRST", "propose.hit_buffer._MANY", "propose.query.READ_TOGETHER"),
    # A bound of work: a pose that has not settled by then is refused.
    "prior.decision._MOVES",
    # Follows from the two pairs that fix a rigid pose: two more confirm it.
    "prior.decision._LEAST_PAIRS",
    # What callers may hand in, arithmetic, and the paper's own bounds.
    *("features.landmark_checks.MINIMUM", "features.landmark_checks.MAXIMUM"),
    *("features.landmark_checks.COORDINATE_LIMIT", "features.landmark_checks.RESOLUTION"),
    *("pose_covariance._LEAST_SPREAD", "config._REACH"),
    *("decide.confidence.QUARTERS", "evaluation.scores.TRANSLATION"),
    *("prior.prior.LEAST_NOISE", "prior.prior.MOST_NOISE", "hints.FOOT", "mapping.landmark_map.PAPER_DISTANCE"),
    *("mapping.landmark_map._SPREAD", "mapping.start_poses._LEAST", "mapping.graph_solver.FIXED"),
    *("mapping.graph_solver._LOOSE", "mapping.agreement.NOBODY", "mapping.pose_graph.MAP"),
}
"""Numbers that are no tuning, by module: they may stand alone."""


def modules() -> Iterator[tuple[str, ast.Module]]:
    """Modules of the method with their source; pictures are laid out by numbers that concern nothing else."""
    for path in sorted(ROOT.rglob("*.py")):
        name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        if not name.startswith("report."):
            yield name, ast.parse(path.read_text(encoding="utf-8"))


def numbers() -> Iterator[tuple[str, ast.ClassDef]]:
    for module, tree in modules():
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and node.name.endswith("Numbers"):
                yield f"{module}.{node.name}", node


def test_every_tuning_number_has_a_sentence_and_a_source() -> None:
    bare, count = [], 0
    for name, node in numbers():
        general = SOURCE.search(ast.get_docstring(node) or "")
        # Name and value, then the sentence: a field without one is followed by the next field, or by nothing.
        for field, after in zip(node.body, [*node.body[1:], None], strict=True):
            if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
                count += 1
                told = ast.literal_eval(after.value) if isinstance(after, ast.Expr) else ""
                if not told or not (general or SOURCE.search(told)):
                    bare.append(f"{name}.{field.target.id}")
    assert count > 90
    assert not bare


def test_no_tuning_number_stands_alone() -> None:
    alone = set()
    for module, tree in modules():
        for node in tree.body:
            if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.value is not None:
                inside = list(ast.walk(node.value))
                leaves = [leaf.value for leaf in inside if isinstance(leaf, ast.Constant)]
                derived = any(isinstance(leaf, ast.Name | ast.Lambda | ast.List | ast.Dict) for leaf in inside)
                if leaves and not derived and all(isinstance(leaf, int | float) for leaf in leaves):
                    alone.add(f"{module}.{node.target.id}")
    assert alone == FIXED
