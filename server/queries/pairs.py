"""How many landmark pairs an answer carries: they are most of its bytes, so their number is limited."""

from server.schemas.queries import QueryAnswer


class PairAllowance:
    """Pairs that one answer may still carry; whole candidates take from it, the best first."""

    def __init__(self, most: int) -> None:
        self._left = most

    def take(self, count: int) -> bool:
        """Whether a candidate's pairs fit. From the first that do not fit on, none are given."""
        fits = count <= self._left
        self._left = self._left - count if fits else 0
        return fits or count == 0


def within(answer: QueryAnswer, most: int) -> QueryAnswer:
    """The answer with at most so many pairs; a candidate whose pairs are left out says how many."""
    if carried(answer) <= most:
        return answer
    allowance = PairAllowance(most)
    candidates = [
        one
        if allowance.take(len(one.inliers))
        else one.model_copy(update={"inliers": [], "inliers_omitted": one.inlier_count})
        for one in answer.candidates
    ]
    return answer.model_copy(update={"candidates": candidates})


def carried(answer: QueryAnswer) -> int:
    """How many pairs an answer carries."""
    return sum(len(one.inliers) for one in answer.candidates)


class Shares:
    """Pairs for several answers together: each gets an equal share of what is left, so none of them uses up all."""

    def __init__(self, most: int, answers: int) -> None:
        self._left, self._answers = most, answers

    def next(self) -> int:
        """The share of the answer that comes next."""
        return self._left // max(self._answers, 1)

    def used(self, pairs: int) -> None:
        """So many pairs went into that answer."""
        self._left -= pairs
        self._answers -= 1
