"""Models with memory."""

from __future__ import annotations

from mapmore_cli.domain.memory import MemoryFit, MemoryModel, StateSet
from mapmore_cli.storage.artefacts.codecs import optional
from mapmore_cli.storage.artefacts.label import NO_UNIT
from mapmore_cli.storage.artefacts.layout.cells import INTEGERS, LIMITS, REAL, REALS, SPAN, TEXT, TEXTS
from mapmore_cli.storage.artefacts.layout.fits import SELECTION
from mapmore_cli.storage.artefacts.schema import Field, Schema, record

STATE_SET = Schema(
    StateSet,
    "States with memory, and everything that their values on a new recording depend on.",
    (
        Field("names", TEXTS, "(s) as `pressure`, `force[k-1]`, `slow(play(pressure, 0.16), 0.3)`", NO_UNIT),
        Field("step", REAL, "time between samples", "s"),
        Field("ranges", LIMITS, "training range of each source of `play`, `stop` and `saturate`, by its name", "that of the source"),
        Field("resonances", LIMITS, "frequency (Hz) and damping ratio that training found, by the name of their source", "Hz, 1"),
        Field("low", REALS, "(s) least training value of each state, scaled to 0; empty where states are not scaled", "that of the state"),
        Field("high", REALS, "(s) greatest training value of each state, scaled to 1; empty likewise", "that of the state"),
        Field("margin", REAL, "how far beyond its training range a scaled state may go, as a fraction of it"),
    ),
)

MEMORY_MODEL = Schema(
    MemoryModel,
    "`output[k] = constant + sum_j theta_j D_j(states[k])`.",
    (
        Field("output", TEXT, "the quantity whose delays are fed back", NO_UNIT),
        Field("states", record(STATE_SET), "states with memory", NO_UNIT),
        Field("terms", TEXTS, "(k) the terms D_j, in the order of selection", NO_UNIT),
        Field("theta", REALS, "(k) coefficients of the terms, of states scaled as `states` says", "those of the terms"),
        Field("theta_error", REALS, "(k) standard errors of theta; NaN without a degree of freedom", "those of the terms"),
        Field("constant", REAL, "the constant", "[target]"),
        Field("limits", SPAN, "least and greatest training output", "[target]"),
    ),
)

MEMORY_FIT = Schema(
    MemoryFit,
    "A model with memory, and how its k terms were chosen of M candidates.",
    (
        Field("model", record(MEMORY_MODEL), "the model", NO_UNIT),
        Field("candidates", TEXTS, "names of all M dictionary terms", NO_UNIT),
        Field("selection", record(SELECTION), "how the terms were found; after pruning, among those kept", NO_UNIT),
        Field("ridge", REAL, "ridge as a fraction of the variance of a standardised candidate; 0 for none"),
        Field("forward", INTEGERS, "candidates chosen before pruning, in their order, from 0", NO_UNIT),
        Field("substitutes", INTEGERS, "(k) candidate that would best replace each term, -1 for none; empty without a ridge", NO_UNIT),
        Field("shares", REALS, "(k) its gain over the term's own; empty without a ridge"),
        Field(
            "held_out",
            optional(REALS),
            "free-run RMSE of the models of 1, 2, ... terms over the last training samples, fitted to the others; inf where diverged",
            "[target]",
        ),
    ),
)
