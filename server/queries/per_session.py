"""The best candidate of every session: the search is repeated, each time without the sessions found so far."""

from collections.abc import Callable
from dataclasses import replace

from server.store.repositories.sessions import Sessions
from urquhart import Candidate, Recognition

Search = Callable[[set[int]], Recognition]
"""A search that leaves out the submaps with these keys."""


def by_session(search: Search, sessions: Sessions, excluded: set[int], limit: int) -> Recognition:
    """The answer to a query with the best candidate of every session that was here, at most `limit`.

    Verdict, reason and rivals are those of the first search. Each further candidate is `matched` in a search of its
    own, among all submaps except those of the sessions found before. Submaps without a session count as one session. If
    the time is over before all sessions are found, the reason is `deadline`.
    """
    first = search(excluded)
    found = _distinct(first, sessions)
    if first.verdict != "matched":
        return replace(first, candidates=tuple(found[:limit]))
    found, excluded, stages = found[:1], set(excluded), list(first.stages)
    end = first.search
    while len(found) < limit:
        excluded |= sessions.beside(found[-1].key)
        following = search(excluded)
        stages += following.stages
        end = replace(end, skipped=tuple(dict.fromkeys(end.skipped + following.search.skipped)))
        if following.verdict != "matched":
            if following.reason == "deadline":
                first, end = replace(first, reason="deadline"), replace(end, stopped_by="deadline")
            break
        found.append(following.candidates[0])
    return replace(first, candidates=tuple(found), stages=tuple(stages), search=end)


def _distinct(answer: Recognition, sessions: Sessions) -> list[Candidate]:
    seen: set[str | None] = set()
    names = sessions.names({candidate.key for candidate in answer.candidates})
    kept = []
    for candidate in answer.candidates:
        if names[candidate.key] not in seen:
            seen.add(names[candidate.key])
            kept.append(candidate)
    return kept
