"""Write models with memory as statements: states, queues, and numbers kept from sample to sample."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.memory import MemoryModel
from mapmore_cli.modelling.memory.evaluation import setting_of
from mapmore_cli.modelling.memory.feedback import fed_back_states, parted
from mapmore_cli.modelling.memory.simulation import bounds_of
from mapmore_cli.modelling.program.statements import NOTHING, Condition, Keep, Kept, Queue, Recall
from mapmore_cli.modelling.program.writing import Lines, kept_number, less, renamed_all, times, total
from mapmore_cli.modelling.terms import Expression, Name, Number, add, parse, power
from mapmore_cli.modelling.terms.operator import Setting
from mapmore_cli.modelling.terms.operators.resonance import Oscillator, oscillator
from mapmore_cli.modelling.terms.states import Lagged, Measured, Operated, State, state
from mapmore_cli.modelling.terms.syntax import ONE, ZERO


@dataclass
class _States:
    """Writes the states of one model down, each once; `seen` counts the samples before this one."""

    lines: Lines
    model: MemoryModel
    inputs: Mapping[str, Expression]
    kept: Kept
    seen: Name
    known: dict[str, Expression] = field(default_factory=dict)
    queues: dict[str, str] = field(default_factory=dict)

    def value(self, found: State) -> Expression:
        """The state in physical units."""
        if found.name not in self.known:
            self.known[found.name] = self._written(found)
        return self.known[found.name]

    def _written(self, found: State) -> Expression:
        match found:
            case Measured(name):
                return self.inputs[name]
            case Lagged(source, steps):
                return self._lagged(source, steps)
            case Operated(operator, source):
                if operator not in WRITERS:
                    raise DataError(f"the operator `{operator}` cannot be exported yet", "fit the model without it")
                x = self.value(source)
                return WRITERS[operator](self, x, setting_of(found, self.model.states), self.at_rest(source))

    def _lagged(self, source: State, steps: int) -> Expression:
        if source.name not in self.queues:
            self.queues[source.name] = self.lines.names.fresh("queue")
            if source != Measured(self.model.output):
                self.value(source)
        queue = self.queues[source.name]
        self.kept.queues[queue] = max(self.kept.queues.get(queue, 0), steps)
        name = self.lines.names.fresh("past")
        self.lines.statements.append(Recall(name, queue, steps))
        return Name(name)

    def at_rest(self, source: State) -> Condition:
        """Up to the first sample on which the source has a value, from which an operator begins at rest."""
        return Condition(self.seen, "<=", Number(float(history_of(source))))

    def queued(self, output: str, value: Expression) -> None:
        """Put what was recalled into its queue."""
        for name, queue in self.queues.items():
            self.lines.statements.append(Queue(queue, value if name == output else self.value(state(name))))


def history_of(found: State) -> int:
    """Samples before the first one on which a state has a value."""
    match found:
        case Measured():
            return 0
        case Lagged(source, steps):
            return history_of(source) + steps
        case Operated(_, source):
            return history_of(source)


def memory_value(lines: Lines, model: MemoryModel, inputs: Mapping[str, Expression], kept: Kept) -> Expression:
    """The model's output at a sample in free run; nothing before there is history, and once it has diverged."""
    lags = fed_back_states(model.states, model.output)
    seen = kept_number(kept, lines, "seen")
    states = _States(lines, model, inputs, kept, seen)
    names = {name: _scaled(lines, model, place, states.value(state(name))) for place, name in enumerate(model.states.names)}
    start = max([0, *lags.values(), *(history_of(state(name)) for name in model.states.names)])
    ready = Lines(lines.names)
    value = _output(ready, model, lags, names)
    early = Condition(seen, "<", Number(float(start)))
    if lags:
        lost = kept_number(kept, lines, "lost")
        value = _bounded(ready, model, lost, value)
    found = lines.choose("memory", [(early, NOTHING)], ready.block(value))
    if lags:
        lines.statements.append(Keep(lost.name, lines.choose("lost", [(early, ZERO), (Condition(found, "==", found), ZERO)], ONE)))
    states.queued(model.output, found)
    if lags:
        kept.fed_back.setdefault(model.output, []).append(states.queues[model.output])
    counted = lines.choose("seen", [(Condition(seen, "<=", Number(float(start))), add(seen, ONE))], seen)
    lines.statements.append(Keep(seen.name, counted))
    return found


def _scaled(lines: Lines, model: MemoryModel, place: int, value: Expression) -> Expression:
    """As `memory.evaluation.scaled`."""
    states = model.states
    if not states.scaled:
        return value
    low, high = float(states.low[place]), float(states.high[place])
    if not high > low:
        return Number(0.0)
    z = lines.let("z", times(less(value, Number(low)), power(Number(high - low), -1)))
    return lines.clip("scaled", z, -states.margin, 1 + states.margin)


def _output(lines: Lines, model: MemoryModel, lags: Mapping[str, int], names: Mapping[str, Expression]) -> Expression:
    """`constant + sum_j theta_j D_j`, the terms of inputs first, as a free run adds them up."""
    driven: list[Expression] = [Number(model.constant)]
    weights: dict[Expression, list[Expression]] = {}
    for text, theta in zip(model.terms, model.theta, strict=True):
        own, inputs = parted(parse(text), lags)
        weight = times(Number(float(theta)), lines.let("driven", renamed_all([inputs], names)[0]))
        (driven if own == ONE else weights.setdefault(own, [])).append(weight)
    fed = [times(lines.let("weight", total(parts)), lines.let("own", renamed_all([own], names)[0])) for own, parts in weights.items()]
    return lines.let("output", total([lines.let("base", total(driven)), *fed]))


def _bounded(lines: Lines, model: MemoryModel, lost: Name, value: Expression) -> Expression:
    """The output while it stays within bounds; nothing from where it leaves them, up to a reset."""
    low, high = bounds_of(model.limits)
    below, above = Condition(value, "<", Number(low)), Condition(value, ">", Number(high))
    return lines.choose("within", [(Condition(lost, ">", ZERO), NOTHING), (below, NOTHING), (above, NOTHING)], value)


def _slow(states: _States, x: Expression, setting: Setting, rest: Condition) -> Expression:
    """`slow`, as deviation from where it began to rest."""
    a = math.exp(-setting.step / setting.numbers[0])
    return _filtered(states, x, rest, 1 - a, (a,))[0]


def _oscillator(setting: Setting) -> Oscillator:
    frequency, damping = setting.numbers
    return oscillator(frequency, damping, setting.step)


def _resonance(states: _States, x: Expression, setting: Setting, rest: Condition) -> Expression:
    first, second, gain, _ = _oscillator(setting)
    return _filtered(states, x, rest, gain, (first, -second))[0]


def _resonance_velocity(states: _States, x: Expression, setting: Setting, rest: Condition) -> Expression:
    first, second, gain, _ = _oscillator(setting)
    lines = states.lines
    y, before = _filtered(states, x, rest, gain, (first, -second))
    moving = Lines(lines.names)
    speed = moving.let("speed", times(less(y, before), power(Number(2 * math.pi * setting.numbers[0] * setting.step), -1)))
    return lines.choose("velocity", [(rest, Number(0.0))], moving.block(speed))


def _filtered(states: _States, x: Expression, rest: Condition, gain: float, past: tuple[float, ...]) -> tuple[Expression, Expression]:
    """`y[k] = gain x[k] + sum_i past_i y[k-i]` of deviations from where x began, and its value a sample before."""
    lines, kept = states.lines, states.kept
    began = kept_number(kept, lines, "began")
    own = [kept_number(kept, lines, "own") for _ in past]
    origin = lines.choose("origin", [(rest, x)], began)
    moving = Lines(lines.names)
    before = moving.let("before", total([times(Number(factor), y) for factor, y in zip(past, own, strict=True)]))
    way = moving.let("way", less(x, origin))
    y = lines.choose("filtered", [(rest, Number(0.0))], moving.block(moving.let("now", total([before, times(Number(gain), way)]))))
    at, previous = lines.let("at", add(y, origin)), lines.let("previous", add(own[0], origin))
    older = [lines.choose("older", [(rest, Number(0.0))], one) for one in own[:-1]]
    for name, value in zip([began, *own], [origin, y, *older], strict=True):
        lines.statements.append(Keep(name.name, value))
    return at, previous


def _play(states: _States, x: Expression, setting: Setting, rest: Condition) -> Expression:
    lines = states.lines
    w = kept_number(states.kept, lines, "play")
    low, high = lines.let("low", less(x, Number(setting.width))), lines.let("high", add(x, Number(setting.width)))
    value = lines.choose("play", [(rest, x), (Condition(low, ">", w), low), (Condition(high, "<", w), high)], w)
    lines.statements.append(Keep(w.name, value))
    return value


def _stop(states: _States, x: Expression, setting: Setting, rest: Condition) -> Expression:
    return states.lines.let("stop", less(x, _play(states, x, setting, rest)))


def _saturate(states: _States, x: Expression, setting: Setting, _rest: Condition) -> Expression:
    return states.lines.clip("saturated", x, *setting.limits)


WRITERS: Mapping[str, Callable[[_States, Expression, Setting, Condition], Expression]] = {
    "slow": _slow,
    "resonance": _resonance,
    "resonance_velocity": _resonance_velocity,
    "play": _play,
    "stop": _stop,
    "saturate": _saturate,
}
"""How every operator goes on from sample to sample, given what it works on and up to when that has been at rest."""
