"""Models with memory as data: what a model file holds and what predicts on a recording that nobody has seen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray
from mapmore_cli.domain.fits import Scaling, SegmentFit, Selection

PIECE = "memory"
"""What tables and equations call the model with memory, where others have segments."""


@dataclass(frozen=True)
class StateSet:
    """States with memory (lags, operators) and everything that their values on a new recording depend on.

    Attributes
    ----------
    names
        As `pressure`, `force[k-1]`, `slow(play(pressure, 0.16), 0.3)`: s states.
    step
        Time between samples, s.
    ranges
        Training range, of every source of `play`, `stop` and `saturate` by its name: widths are fractions of it.
    resonances
        Frequency (Hz) and damping ratio that training found, by the name of their source.
    low, high
        (s,) training range of every state, which is scaled to [0, 1] and clipped `margin` beyond; both empty where states are not scaled.
    margin
        How far beyond its training range a scaled state may go, as a fraction of it.
    """

    names: tuple[str, ...]
    step: float
    ranges: Mapping[str, tuple[float, float]]
    resonances: Mapping[str, tuple[float, float]]
    low: Array
    high: Array
    margin: float

    @property
    def scaled(self) -> bool:
        """Whether states are scaled to their training range."""
        return len(self.low) > 0


@dataclass(frozen=True)
class MemoryModel:
    """`output[k] = constant + sum_j theta_j D_j(states[k])`, the terms D_j in the order of selection.

    Attributes
    ----------
    terms
        Texts of the k terms, products of names of `states`.
    theta, theta_error
        (k,) coefficients and standard errors, of states scaled as `states` says.
    limits
        Training range of the output: a free run that leaves it a hundredfold has diverged.
    start
        How free runs begin: with `measured` outputs, at the `steady` one of the first inputs, or with `identified` ones.
    """

    output: str
    states: StateSet
    terms: tuple[str, ...]
    theta: Array
    theta_error: Array
    constant: float
    limits: tuple[float, float]
    start: str = "measured"

    @property
    def scaling(self) -> Scaling:
        """The scaling of the states, as that of a segment's variables; the constant is its intercept of y."""
        states = self.states
        width = states.high - states.low if states.scaled else np.ones(len(states.names))
        slope = np.divide(1.0, width, out=np.zeros(len(width)), where=width > 0)  # a state that stood still in training is zero
        low = states.low if states.scaled else np.zeros(len(width))
        return Scaling("range" if states.scaled else "none", "-", states.names, slope, -low * slope, 1.0, self.constant)


@dataclass(frozen=True)
class Identified:
    """Numbers of operators that training found.

    Attributes
    ----------
    names
        (m) as `p of wen(force[k-1])`.
    numbers, errors
        (m,) values and standard errors; NaN at a bound.
    held
        (m,) whether the search ended at a bound: the data do not say what the number is.
    """

    names: tuple[str, ...]
    numbers: Array
    errors: Array
    held: BoolArray

    @property
    def notes(self) -> tuple[str, ...]:
        """One for each number at a bound."""
        told = "lies at a bound of its search: the training data ask for more, or do not tell it"
        ends = zip(self.names, self.numbers.tolist(), self.held.tolist(), strict=True)
        return tuple(f"{name} = {number:.4g} {told}" for name, number, held in ends if held)


@dataclass(frozen=True)
class MemoryFit:
    """A model with memory, and how its terms were found.

    Attributes
    ----------
    candidates
        Names of all M dictionary terms.
    selection
        Of the k terms kept; where terms were pruned, ERR are those among the kept ones, and NaN in the tables for all others.
    ridge
        As a fraction of the variance of a standardised candidate; 0 for none.
    forward
        (f,) indices of the candidates that forward selection chose before pruning, in its order.
    substitutes, shares
        (k,) the candidate that would serve best in place of each term beside the others, -1 for none, and its gain over the term's own;
        both empty without a ridge.
    held_out
        Where free runs decided on the number of terms: RMSE of the models of 1, 2, ... terms over the last training samples, which they
        were not fitted to; infinite where a run diverged.
    identified
        The numbers of operators that the dictionary left open; None where it left none.
    """

    model: MemoryModel
    candidates: tuple[str, ...]
    selection: Selection
    ridge: float
    forward: IntArray
    substitutes: IntArray
    shares: Array
    held_out: Array | None = None
    identified: Identified | None = None

    @property
    def piece(self) -> SegmentFit:
        """The fit as that of a single segment, for tables of terms."""
        return SegmentFit(PIECE, PIECE, (), self.candidates, self.model.scaling, self.selection)
