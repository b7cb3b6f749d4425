"""Models with memory."""

from __future__ import annotations

from collections.abc import Iterator

from mapmore_cli.domain.memory import Identified, MemoryFit, MemoryModel, StateSet
from mapmore_cli.modelling.expressions import ExpressionError, state
from mapmore_cli.modelling.expressions.states import Measured, Operated
from mapmore_cli.modelling.memory.states import setting_of
from mapmore_cli.storage.artefacts.codecs import added, named, number, numbers, optional, shown, text
from mapmore_cli.storage.artefacts.layout.cells import (
    ANY_REALS,
    NAME,
    PAIR,
    REALS,
    SPAN,
    expression_faults,
)
from mapmore_cli.storage.artefacts.layout.derived import stored
from mapmore_cli.storage.artefacts.schema import Fault


def _state_faults(states: StateSet) -> Iterator[Fault]:
    for name in states.names:
        try:
            found = state(name)
        except ExpressionError as error:
            yield "names", f"has {shown(name)}, which is no state: {error}"
            continue
        while not isinstance(found, Measured):
            try:
                _ = setting_of(found, states) if isinstance(found, Operated) else None
            except KeyError:
                yield "ranges", f"and `resonances` say nothing of {shown(found.source.name)}, which {shown(name)} is made of"
            found = found.source
    if len({*states.names}) < len(states.names):
        yield "names", "name a state twice"
    if states.step <= 0:
        yield "step", f"is {states.step:g} s"
    if len(states.low) != len(states.high):
        yield "low", f"has {len(states.low)} values, where `high` has {len(states.high)}"
    elif (states.low > states.high).any():
        yield "low", "is above `high`"


STATE_SET = stored(StateSet, {"resonances": named(PAIR), "low": REALS, "high": REALS, "margin": number(float, least=0)}, rule=_state_faults)


def _memory_faults(model: MemoryModel) -> Iterator[Fault]:
    return expression_faults("terms", model.terms, model.states.names)


MEMORY_MODEL = stored(
    MemoryModel,
    {"output": NAME, "theta": REALS, "limits": SPAN, "start": added(text(words=("measured", "steady", "identified")), "measured")},
    rule=_memory_faults,
)


def _memory_fit_faults(fit: MemoryFit) -> Iterator[Fault]:
    for field in ("forward", "substitutes"):
        indices = getattr(fit, field)
        if indices.size and indices.max() >= len(fit.candidates):
            yield field, f"names candidate {indices.max()} of {len(fit.candidates)}"


IDENTIFIED = stored(Identified, {"numbers": REALS})


MEMORY_FIT = stored(
    MemoryFit,
    {
        "ridge": number(float, least=0),
        "substitutes": numbers("<i8", least=-1),
        "held_out": optional(ANY_REALS),
    },
    rule=_memory_fit_faults,
)
