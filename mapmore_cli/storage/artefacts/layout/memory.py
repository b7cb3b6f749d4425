"""Models with memory."""

from __future__ import annotations

from collections.abc import Iterator

from mapmore_cli.domain.memory import Identified, MemoryFit, MemoryModel, StateSet
from mapmore_cli.modelling.expressions import ExpressionError, state
from mapmore_cli.storage.artefacts.codecs import added, named, number, numbers, optional, shown, text
from mapmore_cli.storage.artefacts.label import NO_UNIT
from mapmore_cli.storage.artefacts.layout.cells import (
    ANY_REALS,
    FLAGS,
    INDICES,
    LIMITS,
    NAME,
    PAIR,
    REAL,
    REALS,
    SPAN,
    TEXTS,
    expression_faults,
)
from mapmore_cli.storage.artefacts.layout.derived import completed
from mapmore_cli.storage.artefacts.layout.fits import SELECTION
from mapmore_cli.storage.artefacts.schema import Fault, Field, Schema, record


def _state_faults(states: StateSet) -> Iterator[Fault]:
    for name in states.names:
        try:
            state(name)
        except ExpressionError as error:
            yield "names", f"has {shown(name)}, which is no state: {error}"
    if states.step <= 0:
        yield "step", f"is {states.step:g} s"
    if len(states.low) != len(states.high):
        yield "low", f"has {len(states.low)} values, where `high` has {len(states.high)}"
    elif (states.low > states.high).any():
        yield "low", "is above `high`"


STATE_SET = Schema(
    StateSet,
    "States with memory, and everything that their values on a new recording depend on.",
    (
        Field("names", TEXTS, "(s) as `pressure`, `force[k-1]`, `slow(play(pressure, 0.16), 0.3)`", NO_UNIT),
        Field("step", REAL, "time between samples", "s"),
        Field("ranges", LIMITS, "training range of each source of `play`, `stop` and `saturate`, by its name", "that of the source"),
        Field("resonances", named(PAIR), "frequency (Hz) and damping ratio that training found, by the name of their source", "Hz, 1"),
        Field(
            "low", REALS, "(s or 0) least training value of each state, scaled to 0; empty where states are not scaled", "that of the state"
        ),
        Field("high", REALS, "(s or 0) greatest training value of each state, scaled to 1; empty likewise", "that of the state"),
        Field("margin", number(float, least=0), "how far beyond its training range a scaled state may go, as a fraction of it"),
    ),
    rule=_state_faults,
)


def _memory_faults(model: MemoryModel) -> Iterator[Fault]:
    return expression_faults("terms", model.terms, model.states.names)


MEMORY_MODEL = completed(
    Schema(
        MemoryModel,
        "`output[k] = constant + sum_j theta_j D_j(states[k])`.",
        (
            Field("output", NAME, "the quantity whose delays are fed back", NO_UNIT),
            Field("states", record(STATE_SET), "states with memory", NO_UNIT),
            Field("terms", TEXTS, "(k) the terms D_j, in the order of selection", NO_UNIT),
            Field("theta", REALS, "(k) coefficients of the terms, of states scaled as `states` says", "those of the terms"),
            Field("theta_error", ANY_REALS, "(k) standard errors of theta; NaN without a degree of freedom", "those of the terms"),
            Field("constant", REAL, "the constant", "[target]"),
            Field("limits", SPAN, "least and greatest training output", "[target]"),
            Field("start", added(text(words=("measured", "steady", "identified")), "measured"), "how free runs begin", NO_UNIT),
        ),
        rule=_memory_faults,
    )
)


def _memory_fit_faults(fit: MemoryFit) -> Iterator[Fault]:
    for field in ("forward", "substitutes"):
        indices = getattr(fit, field)
        if indices.size and indices.max() >= len(fit.candidates):
            yield field, f"names candidate {indices.max()} of {len(fit.candidates)}"


IDENTIFIED = Schema(
    Identified,
    "Numbers of operators that training found.",
    (
        Field("names", TEXTS, "(m) as `p of wen(force[k-1])`", NO_UNIT),
        Field("numbers", REALS, "(m) the numbers", "s, Hz or 1"),
        Field("errors", ANY_REALS, "(m) standard errors; NaN at a bound", "those of the numbers"),
        Field("held", FLAGS, "(m) 1 where the search ended at a bound", NO_UNIT),
    ),
)


MEMORY_FIT = completed(
    Schema(
        MemoryFit,
        "A model with memory, and how its k terms were chosen of M candidates.",
        (
            Field("model", record(MEMORY_MODEL), "the model", NO_UNIT),
            Field("candidates", TEXTS, "(M) names of all M dictionary terms", NO_UNIT),
            Field("selection", record(SELECTION), "how the terms were found; after pruning, among those kept", NO_UNIT),
            Field("ridge", number(float, least=0), "ridge as a fraction of the variance of a standardised candidate; 0 for none"),
            Field("forward", INDICES, "candidates chosen before pruning, in their order, from 0", NO_UNIT),
            Field(
                "substitutes",
                numbers("<i8", least=-1),
                "(k or 0) candidate that would best replace each term, -1 for none; empty without a ridge",
                NO_UNIT,
            ),
            Field("shares", ANY_REALS, "(k or 0) its gain over the term's own; empty without a ridge"),
            Field(
                "held_out",
                optional(ANY_REALS),
                "free-run RMSE of the models of 1, 2, ... terms over the last training samples, fitted to the others; inf where diverged",
                "[target]",
            ),
            Field(
                "identified",
                optional(record(IDENTIFIED)),
                "the numbers of operators that the dictionary left open, where it left any",
                NO_UNIT,
            ),
        ),
        rule=_memory_fit_faults,
    )
)
