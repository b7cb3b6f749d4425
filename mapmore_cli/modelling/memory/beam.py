"""Terms chosen by their free run: a beam of the best few models of each size, forward, then backward."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.modelling.frols.ridge import Regularised
from mapmore_cli.modelling.memory.refinement import QUICK, Coefficients, minimise, refine
from mapmore_cli.modelling.memory.training import Training

WIDTH = 3
"""Models of each size that are carried on."""

SHORTLIST = 5
"""Candidates that are tried beside each of them: the best of a step one step ahead."""


@dataclass(frozen=True)
class Member:
    """A model of the beam: indices of its terms, in the order in which they were taken, and its coefficients of least simulation error."""

    chosen: tuple[int, ...]
    point: Coefficients


Tick = Callable[[], None]
"""Called for every model that is tried."""


def trials(sizes: int) -> int:
    """How many models `beam` tries at most."""
    return SHORTLIST + (sizes - 1) * WIDTH * SHORTLIST + sizes * (sizes + 1) // 2 - 1


def beam(training: Training, sizes: int, tick: Tick) -> list[Member]:
    """Return the best model of 1, 2, ... terms, up to `sizes` of them; models whose free run diverges are left out.

    Forward, each of the `WIDTH` best models of a size is tried with each of the best few candidates of the next step of FROLS. Backward,
    the largest gives up the term whose loss its free run feels least, and so on.
    """
    ranking = training.selector.ranking
    best: list[Member] = []
    members = [Member((), Coefficients(np.empty(0), 0.0))]
    for _ in range(sizes):
        tried: dict[frozenset[int], Member] = {}
        for member in members:
            for candidate in shortlist(ranking, member.chosen):
                chosen = (*member.chosen, candidate)
                if frozenset(chosen) not in tried:
                    tried[frozenset(chosen)] = _grown(training, member, chosen)
                    tick()
        members = _best_of(tried.values())
        if not members:
            break
        best.append(members[0])
    return _pruned(training, best, tick)


def shortlist(ranking: Regularised, chosen: Sequence[int]) -> list[int]:
    """Return the candidates that reduce the error one step ahead most beside the chosen ones, the best first."""
    gains = reductions(ranking, np.array(chosen, dtype=np.int64))
    order = np.argsort(-gains, kind="stable")[:SHORTLIST]
    return [int(place) for place in order if gains[place] > 0]


def reductions(data: Regularised, chosen: IntArray) -> Array:
    """(M,) by how much each candidate reduces the regularised error beside the chosen ones; zero for these."""
    gram, products = data.gram, data.products
    if not len(chosen):
        return products**2 / np.maximum(np.diag(gram), data.ridge)
    solved = cho_solve(cho_factor(gram[np.ix_(chosen, chosen)]), gram[chosen])
    squares = np.diag(gram) - np.einsum("ij,ij->j", gram[chosen], solved)
    gains = (products - products[chosen] @ solved) ** 2 / np.maximum(squares, data.ridge)
    gains[chosen] = 0.0
    return np.asarray(gains)


def _grown(training: Training, member: Member, chosen: tuple[int, ...]) -> Member:
    """One more term, from two starts: the coefficients of the smaller model, and those of one step ahead."""
    problem = training.problem(np.array(chosen))
    smaller = Coefficients(np.append(member.point.theta, 0.0), member.point.constant)
    found = training.selector.among(np.array(chosen))
    order = [found.selection.chosen.tolist().index(place) for place in chosen]
    ahead = Coefficients(found.selection.theta[order], found.constant)
    points = [minimise(problem, smaller, None, QUICK), refine(problem, ahead, QUICK)]
    return Member(chosen, min(points, key=lambda point: point.error))


def _best_of(members: Iterable[Member]) -> list[Member]:
    finite = [member for member in members if np.isfinite(member.point.error)]
    return sorted(finite, key=lambda member: member.point.error)[:WIDTH]


def _pruned(training: Training, best: list[Member], tick: Tick) -> list[Member]:
    """Return the best of each size, forward or by deletion from the next larger."""
    for size in range(len(best) - 1, 0, -1):
        larger = best[size]
        tried = [best[size - 1]]
        for place in range(len(larger.chosen)):
            chosen = tuple(np.delete(larger.chosen, place).tolist())
            point = Coefficients(np.delete(larger.point.theta, place), larger.point.constant)
            tried.append(Member(chosen, minimise(training.problem(np.array(chosen)), point, None, QUICK)))
            tick()
        best[size - 1] = _best_of(tried)[0]
    return best
