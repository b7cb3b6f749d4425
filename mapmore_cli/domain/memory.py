"""Models with memory as data: what a model file holds and what predicts on a recording that nobody has seen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, IntArray
from mapmore_cli.domain.fits import Scaling, SegmentFit, Selection

PIECE = "memory"
"""What tables and equations call the model with memory, where others have segments."""


@dataclass(frozen=True)
class StateSet:
    """States with memory, and everything that their values on a new recording depend on.

    Widths of `play`, `stop` and `saturate` are fractions of `ranges`. Scaled states are clipped `margin` beyond [0, 1].
    """

    names: Annotated[tuple[str, ...], "(s) as `pressure`, `force[k-1]`, `slow(play(pressure, 0.16), 0.3)`"]
    step: Annotated[float, "time between samples", "s"]
    ranges: Annotated[
        Mapping[str, tuple[float, float]],
        "training range of each source of `play`, `stop` and `saturate`, by its name",
        "that of the source",
    ]
    resonances: Annotated[
        Mapping[str, tuple[float, float]], "frequency (Hz) and damping ratio that training found, by the name of their source", "Hz, 1"
    ]
    low: Annotated[
        Array, "(s or 0) least training value of each state, scaled to 0; empty where states are not scaled", "that of the state"
    ]
    high: Annotated[Array, "(s or 0) greatest training value of each state, scaled to 1; empty likewise", "that of the state"]
    margin: Annotated[float, "how far beyond its training range a scaled state may go, as a fraction of it"]

    @property
    def scaled(self) -> bool:
        """Whether states are scaled to their training range."""
        return len(self.low) > 0


@dataclass(frozen=True)
class MemoryModel:
    """`output[k] = constant + sum_j theta_j D_j(states[k])`.

    A free run that leaves `limits` a hundredfold has diverged. It begins with `measured` outputs, at the `steady` one of the first inputs,
    or with `identified` ones (`start`).
    """

    output: Annotated[str, "the quantity whose delays are fed back"]
    states: Annotated[StateSet, "states with memory"]
    terms: Annotated[tuple[str, ...], "(k) the terms D_j, in the order of selection"]
    theta: Annotated[Array, "(k) coefficients of the terms, of states scaled as `states` says", "those of the terms"]
    theta_error: Annotated[Array, "(k) standard errors of theta; NaN without a degree of freedom", "those of the terms"]
    constant: Annotated[float, "the constant", "[target]"]
    limits: Annotated[tuple[float, float], "least and greatest training output", "[target]"]
    start: Annotated[str, "how free runs begin"] = "measured"

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

    Where the search ended at a bound (`held`), the data do not say what the number is.
    """

    names: Annotated[tuple[str, ...], "(m) as `p of wen(force[k-1])`"]
    numbers: Annotated[Array, "(m) the numbers", "s, Hz or 1"]
    errors: Annotated[Array, "(m) standard errors; NaN at a bound", "those of the numbers"]
    held: Annotated[BoolArray, "(m) 1 where the search ended at a bound"]

    @property
    def notes(self) -> tuple[str, ...]:
        """One for each number at a bound."""
        told = "lies at a bound of its search: the training data ask for more, or do not tell it"
        ends = zip(self.names, self.numbers.tolist(), self.held.tolist(), strict=True)
        return tuple(f"{name} = {number:.4g} {told}" for name, number, held in ends if held)


@dataclass(frozen=True)
class MemoryFit:
    """A model with memory, and how its k terms were chosen of M candidates.

    Where terms were pruned, the ERR of `selection` are those among the terms kept, and NaN in the tables for all others.
    """

    model: Annotated[MemoryModel, "the model"]
    candidates: Annotated[tuple[str, ...], "(M) names of all M dictionary terms"]
    selection: Annotated[Selection, "how the terms were found; after pruning, among those kept"]
    ridge: Annotated[float, "ridge as a fraction of the variance of a standardised candidate; 0 for none"]
    forward: Annotated[IntArray, "candidates chosen before pruning, in their order, from 0", "-"]
    substitutes: Annotated[IntArray, "(k or 0) candidate that would best replace each term, -1 for none; empty without a ridge", "-"]
    shares: Annotated[Array, "(k or 0) its gain over the term's own; empty without a ridge"]
    held_out: Annotated[
        Array | None,
        "free-run RMSE of the models of 1, 2, ... terms over the last training samples, fitted to the others; inf where diverged",
        "[target]",
    ] = None
    identified: Annotated[Identified | None, "the numbers of operators that the dictionary left open, where it left any"] = None

    @property
    def piece(self) -> SegmentFit:
        """The fit as that of a single segment, for tables of terms."""
        return SegmentFit(PIECE, PIECE, (), self.candidates, self.model.scaling, self.selection)
