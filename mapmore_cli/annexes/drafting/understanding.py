"""What is understood of a study before its recordings are read: what is predicted, by what."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mapmore_cli.annexes.drafting.answers import Answers
from mapmore_cli.annexes.drafting.columns import (
    Table,
    kind_to_predict,
    known_by_titles,
    named_by_person,
    refuse_choice,
    target_of,
)
from mapmore_cli.annexes.drafting.draft import Column, Named
from mapmore_cli.annexes.drafting.names import Condition, told_by_names
from mapmore_cli.annexes.drafting.sources import Study
from mapmore_cli.checking.evidence import FEWEST, ROUNDING, same_signals
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import UsageError


@dataclass(frozen=True)
class Understood:
    """The columns of a study, which of them are predicted and which drive, what names tell beside
    them, and what is left out.
    """

    columns: Named
    targets: list[str]
    inputs: list[str]
    conditions: list[Condition]
    remark: str
    left_out: dict[Column, str]

    @property
    def drives(self) -> list[str]:
        """The inputs, those that names tell included."""
        return [*self.inputs, *(one.quantity for one in self.conditions)]

    def without_others(self, target: str) -> Named:
        """Return the columns without the other targets."""
        others = {*self.targets} - {target}
        return {name: one for name, one in self.columns.items() if name not in others}

    def summary(self) -> dict[str, str]:
        """Return what was understood, in words."""
        told = {
            name: f"{name} (column {one.column}, in {one.unit})"
            for name, one in self.columns.items()
        } | {
            one.quantity: f"{one.quantity} (names, in {one.unit or '1'})" for one in self.conditions
        }
        return {
            "predicted": ", ".join(told[name] for name in self.targets),
            "by": ", ".join(told[name] for name in self.drives),
            "time": told.get("time", "none"),
        }


def understood(study: Study, table: Table, answers: Answers, path: str) -> Understood:
    """Return what titles, names and a person say of a study.

    Raises
    ------
    UsageError
        Where neither titles nor the person say what is to be predicted, or where something that
        the person names is not there.
    """
    own, left_out = known_by_titles(table)
    if answers.columns:
        own, left_out = named_by_person(answers.columns, table, "--columns", {}), {}
    settled = {name: one for name, one in answers.settled.items() if one is not None}
    own = settled | {name: one for name, one in own.items() if name not in answers.settled}
    chosen = named_by_person(answers.target, table, "--target", own)
    columns = own | chosen
    said = answers.inputs or {}
    given = [name for name, one in said.items() if not one.refers_to(name)]
    conditions, repeats = told_by_names(study.names, answers.hold, [*columns, *given])
    titled = {} if answers.columns else table
    kinds = {
        name: kind_to_predict(name, titled.get(one.column))
        for name, one in columns.items()
        if name != "time"
    }
    targets = [*chosen] or [*filter(None, [target_of(kinds, bool(conditions))])]
    if not targets:
        raise refuse_choice(table, study.files[0].name, path)
    if answers.inputs is None:
        inputs = _free(table, columns, targets, left_out)
    else:
        beside = {one.quantity for one in conditions}
        rest = {name: one for name, one in said.items() if name not in beside}
        asked = named_by_person(rest, table, "--inputs", columns)
        columns |= asked
        inputs = [name for name in asked if name not in targets]
        keep = {*said, answers.hold.name if answers.hold else ""}
        unused = [one for one in conditions if not one.unit and one.quantity not in keep]
        conditions = [one for one in conditions if one not in unused]
        repeats += [f"{one.quantity} (name it by --inputs)" for one in unused]
    if not inputs and not conditions:
        raise UsageError(
            f"{study.files[0].name}: nothing is left that drives {targets[0]}",
            "name it by --inputs, or what was held by --hold",
        )
    used = dict.fromkeys([*(["time"] if "time" in columns else []), *inputs, *targets])
    remark = f"numbers not used: {', '.join(dict.fromkeys(repeats))}" if repeats else ""
    columns = {name: columns[name] for name in used}
    return Understood(columns, targets, inputs, conditions, remark, left_out)


def _free(
    table: Table,
    columns: Named,
    targets: Sequence[str],
    left_out: dict[Column, str],
) -> list[str]:
    """Return all columns that may drive the targets; those that are one signal with a target, or
    of which it is a linear filter while others drive, are left out and told.
    """
    free = {name: one.column for name, one in columns.items() if name not in {"time", *targets}}
    for target in targets:
        wanted = table[columns[target].column]
        for name, column in list(free.items()):
            own = table[column]
            if own.kind not in ("", wanted.kind):
                continue
            both = [np.concatenate(one.values) for one in (own, wanted)]
            is_copy = same_signals(both)
            if is_copy or (len(free) > 1 and _is_filtered(own.values, wanted.values)):
                del free[name]
                how = "is a copy of" if is_copy else "gives by a linear filter"
                left_out[column] = f"{how} {target}: name it by --inputs to use it"
    return list(free)


def _is_filtered(x: Sequence[Array], y: Sequence[Array]) -> bool:
    """Return True where `y[k] = a x[k] + b x[k-1] + c x[k-2] + d` to 1e-4 of the range of y: it was
    computed from x.
    """
    pairs = list(zip(x, y, strict=True))
    if any(len(one) != len(other) or len(one) < FEWEST for one, other in pairs):
        return False
    rows = [np.column_stack([one[2:], one[1:-1], one[:-2]]) for one, _ in pairs]
    wanted = np.concatenate([other[2:] for _, other in pairs])
    design = np.column_stack([np.concatenate(rows), np.ones(len(wanted))])
    left = wanted - design @ np.linalg.lstsq(design, wanted, rcond=None)[0]
    return bool(np.abs(left).max() <= ROUNDING * np.ptp(wanted))
