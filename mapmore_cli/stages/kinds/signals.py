"""From derivations of the spec to signals that a model can repeat on a table."""

from __future__ import annotations

import graphlib
from collections.abc import Mapping

from mapmore_cli.domain.models import Signal
from mapmore_cli.spec.experiment import ExperimentSpec
from mapmore_cli.spec.sections.data import Direction, Rate
from mapmore_cli.spec.sections.method import CutByDirection
from mapmore_cli.spec.units import convert, default_unit


def signal_of(name: str, rule: Rate | Direction, units: Mapping[str, str]) -> Signal:
    """The signal that a rule derives, in the model's `units`."""
    if isinstance(rule, Direction):
        return Signal(name, "direction", rule.direction_of, dead_band=rule.dead_band)
    return Signal(
        name,
        "rate",
        rule.rate_of,
        window=rule.window,
        order=rule.order,
        factor=convert(1.0, f"{units[rule.rate_of]}/s", units[name]),
        seconds=convert(1.0, units["time"], "s"),
    )


def derivations_of(spec: ExperimentSpec) -> dict[str, str | Rate | Direction]:
    """What the spec derives, with the direction that segments are cut by."""
    cuts = {name: cut for name, cut in spec.segment.items() if isinstance(cut, CutByDirection)}
    return {**spec.data.derive, **{name: Direction(direction_of=cut.of, dead_band=cut.dead_band) for name, cut in cuts.items()}}


def units_of(spec: ExperimentSpec) -> dict[str, str]:
    """The model's unit of every quantity; a rate by any name has the unit of its quantity per unit of time."""
    rates = {name: rule.rate_of for name, rule in spec.data.derive.items() if isinstance(rule, Rate)}
    return {name: default_unit(name, spec.units, rates) for name in spec.quantities}


def signals_of(spec: ExperimentSpec) -> tuple[Signal, ...]:
    """All rates and directions of a study, each after the one that it follows from."""
    units = units_of(spec)
    signals = {name: signal_of(name, rule, units) for name, rule in derivations_of(spec).items() if not isinstance(rule, str)}
    order = graphlib.TopologicalSorter({name: {signal.of} for name, signal in signals.items()}).static_order()
    return tuple(signals[name] for name in order if name in signals)
