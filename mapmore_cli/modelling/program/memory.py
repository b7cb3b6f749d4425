"""Write models with memory as statements: states, queues, and numbers kept from sample to sample."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from mapmore_cli.domain.memory import MemoryModel
from mapmore_cli.modelling.memory.evaluation import setting_of
from mapmore_cli.modelling.memory.feedback import fed_back_states, parted
from mapmore_cli.modelling.memory.simulation import bounds_of
from mapmore_cli.modelling.program.statements import NOTHING, Keep, Kept, Queue, Recall
from mapmore_cli.modelling.program.writing import Lines, kept_number, less, renamed_all, times, total
from mapmore_cli.modelling.terms import Expression, Name, Number, add, parse, power
from mapmore_cli.modelling.terms.operator import Recursion
from mapmore_cli.modelling.terms.operators import OPERATORS
from mapmore_cli.modelling.terms.states import Lagged, Measured, Operated, State, state
from mapmore_cli.modelling.terms.syntax import ONE, ZERO, Condition


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
                return self._operated(operator, OPERATORS[operator].recursion(setting_of(found, self.model.states)), source)

    def _operated(self, name: str, rule: Recursion, source: State) -> Expression:
        """An operator from its kept values, at rest up to the first sample on which its source has a value."""
        lines, x = self.lines, self.value(source)
        x = lines.let("source", x)
        if rule.own == rule.source == 0:
            return lines.let(name, rule.next(lines, x))
        own = [kept_number(self.kept, lines, name) for _ in range(rule.own)]
        past = [kept_number(self.kept, lines, "source") for _ in range(rule.source)]
        rest = Condition(self.seen, "<=", Number(float(history_of(source))))
        value = lines.where(rest, rule.rest(x), lambda: rule.next(lines, *own, x, *past))
        for kept, now in ((own, value), (past, x)):
            older = [now, *(lines.where(rest, now, one) for one in kept[:-1])]
            lines.statements.extend(Keep(name.name, one) for name, one in zip(kept, older, strict=False))
        return value

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
    return lines.clip(z, -states.margin, 1 + states.margin, "scaled")


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
