"""Explanations of answers, as data and as drawings."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from server.resources import links
from server.schemas.common import Members
from server.schemas.poses import Transform
from server.schemas.queries import ExplanationAnswer, ExplanationLinks, QueryAnswer
from urquhart import SE2, Stage
from urquhart.budget import UNBOUNDED, Budget
from urquhart.hints import Hint
from urquhart.report.explanation import ExplainedFinding, Explanation, PoseDrawing, draw_explanation, sentence
from urquhart.verify.distortion import WARNINGS


@dataclass(frozen=True, slots=True)
class QueryExplanation:
    """An answer with everything that its explanation needs.

    Attributes:
        name: of the query, for people.
        answer: with its findings, where they were kept.
        query_xy: (N, 2) float64, metres, query frame.
        submaps: landmarks (M, 2) float64, metres, submap frame, by submap id, where they are those that were searched.
    """

    name: str
    answer: QueryAnswer
    query_xy: NDArray[np.float64]
    submaps: Mapping[str, NDArray[np.float64]]

    def to_answer(self) -> ExplanationAnswer:
        """The explanation of a stored query as data."""
        answer = self.answer
        query_id = answer.id or ""
        return ExplanationAnswer(
            query_id=query_id,
            collection=answer.collection,
            verdict=answer.verdict,
            reason=answer.reason,
            lead=answer.lead,
            gates=answer.gates,
            search=answer.search,
            stages=answer.stages,
            findings=answer.findings,
            findings_total=answer.findings_total,
            rivals=answer.rivals,
            sentences=sentences(answer),
            links=ExplanationLinks(
                self=links.explanation(answer.collection, query_id), query=links.query(answer.collection, query_id)
            ),
        )

    def to_svg(self, budget: Budget = UNBOUNDED) -> str:
        """The explanation as a drawing. Raises urquhart.budget.DeadlinePassed and Abandoned."""
        answer = self.answer
        total = sum(stage.milliseconds for stage in answer.stages)
        subtitles = [
            f"{answer.landmark_count} landmarks; {answer.collection} at revision {answer.revision}; {total:.1f} ms"
        ]
        if answer.search is not None:
            subtitles.append(f"{answer.search.sentence.capitalize()}.")
        if answer.lead is not None:
            gates = answer.gates
            subtitles.append(
                f"It leads the best other pose by {answer.lead:.1f}; asked are {gates.lead:.1f} and "
                f"{gates.lead_per_landmark:g} more for each tree of the overlap, and {gates.lead_ratio:.0%} of the "
                "other's evidence."
            )
        findings = None
        if answer.findings is not None:
            findings = [
                ExplainedFinding(
                    one.level,
                    one.submap_id,
                    one.support,
                    one.inlier_count,
                    one.overlap_count,
                    one.evidence,
                    one.log_odds,
                    one.refused,
                )
                for one in answer.findings
            ]
        laid = self._laid()
        return draw_explanation(
            Explanation(
                title=f"{self.name}: {answer.verdict}",
                subtitles=subtitles,
                reason=answer.reason,
                gate=answer.gates.log_odds,
                stages=[Stage(stage.name, stage.milliseconds, stage.counts) for stage in answer.stages],
                findings=findings,
                findings_total=answer.findings_total or 0,
                query_xy=self.query_xy,
                drawings=laid,
                missing=bool(answer.candidates) and not laid,
            ),
            budget,
        )

    def _laid(self) -> list[PoseDrawing]:
        answer = self.answer
        if not answer.candidates or answer.candidates[0].submap_id not in self.submaps:
            return []
        best = answer.candidates[0]
        pose = _se2(best.transform)
        weight = f"evidence {best.evidence:.1f}, {best.inlier_count} inliers"
        laid = [PoseDrawing(f"best: {best.submap_id}", weight, self.submaps[best.submap_id], pose)]
        for rival in answer.rivals[:1]:
            if rival.submap_id in self.submaps:
                there = _se2(rival.transform)
                weight = f"evidence {rival.evidence:.1f}, {rival.inlier_count} inliers"
                if rival.submap_id == best.submap_id:
                    centre = self.query_xy.mean(axis=0, keepdims=True)
                    metres = float(np.hypot(*(there.apply(centre) - pose.apply(centre))[0]))
                    degrees = math.degrees(there.distance(pose)[1])
                    weight += f"; {metres:.1f} m and {degrees:.0f}\N{DEGREE SIGN} from the best"
                laid.append(PoseDrawing(f"rival: {rival.submap_id}", weight, self.submaps[rival.submap_id], there))
        return laid


def sentences(answer: QueryAnswer) -> dict[str, str]:
    """The meaning of each reason and each warning in an answer, by its word."""
    refused = [one.refused for one in (*answer.candidates, *(answer.findings or ())) if one.refused is not None]
    warnings = [*answer.warnings, *(word for one in answer.candidates for word in one.warnings)]
    meant = {reason: sentence(reason) for reason in dict.fromkeys([answer.reason, *refused])}
    return meant | {word: WARNINGS.get(word, word) for word in dict.fromkeys(warnings)}


def hint_answers(hint: Hint | None, ids: Mapping[int, str]) -> list[Members]:
    """The hint, if there is one: members of a `HintAnswer`. `ids`: submap ids by key."""
    if hint is None:
        return []
    return [
        {
            "word": hint.word,
            "factor": hint.factor,
            "submap_id": ids[hint.key],
            "inlier_count": hint.inliers,
            "sentence": hint.sentence,
        }
    ]


def _se2(pose: Transform) -> SE2:
    return SE2(pose.x, pose.y, pose.yaw)
