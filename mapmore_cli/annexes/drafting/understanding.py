"""Interpret a study before its recordings are read: find the target and the inputs."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from mapmore_cli.annexes.drafting.answers import Answers
from mapmore_cli.annexes.drafting.by_person import named_by_person, refuse_choice
from mapmore_cli.annexes.drafting.by_titles import kind_to_predict, known_by_titles, target_of
from mapmore_cli.annexes.drafting.columns import Table, TitledColumn
from mapmore_cli.annexes.drafting.draft import Column, Named, address
from mapmore_cli.annexes.drafting.finding import find
from mapmore_cli.annexes.drafting.names import NamedCondition, told_by_names
from mapmore_cli.annexes.drafting.reading import some_of
from mapmore_cli.annexes.drafting.studies import FolderStudy
from mapmore_cli.checking.evidence import FEWEST, ROUNDING, same_signals
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.modelling.signals.sampling import correlation
from mapmore_cli.study.units import can_convert

FEWEST_SET_POINTS, SAME_SET_POINT = 3, 0.999
"""Numbers in the names of files are treated as the set points of what a column measures if there
are at least `FEWEST_SET_POINTS` different numbers (two numbers are perfectly correlated with any
two means), and if their correlation with the means of the column is larger than `SAME_SET_POINT`.
"""


@dataclass(frozen=True)
class Understood:
    """Interpretation of a study.

    Attributes
    ----------
    columns
        The columns that are read, by quantity.
    targets, inputs
        The quantities to predict, and the columns that are inputs.
    conditions, remark
        The quantities whose values are in names of files, and a remark about the numbers in names
        that are not used.
    left_out
        The reason for each column that is left out.
    group
        The quantity that distinguishes groups. It is a column or a word in names of files.
    apart
        The quantities whose values distinguish the recordings of one file.
    """

    columns: Named
    targets: list[str]
    inputs: list[str]
    conditions: list[NamedCondition]
    remark: str
    left_out: dict[Column, str]
    group: str | None
    apart: list[str]

    def drive_called(self, reference: str, table: Table, option: str) -> str:
        """Return the name of the input that a person means by a name, a title or a number. Raises
        UsageError if there is none.
        """
        drives = [*self.inputs, *(condition.quantity for condition in self.conditions)]
        if reference in drives:
            return reference
        column = find(table, address(reference), option).column
        for name in self.inputs:
            if self.columns[name].column == column:
                return name
        raise UsageError(
            f"{option}: {reference} is not an input", f"name one of {', '.join(drives)}"
        )


def understood(
    study: FolderStudy, table: Table, answers: Answers, path: str, is_driven: bool
) -> Understood:
    """Find out which quantities of a study are targets, inputs and levels. Use the titles of
    columns, the names of files and the answers of a person. `is_driven` is True if a second log
    holds an input.

    Raises
    ------
    UsageError
        If neither titles nor the person say what to predict, or if something that the person names
        does not exist.
    """
    columns, left_out = _columns_of(table, answers)
    apart: Named = {}
    for reference in answers.recordings:
        apart |= _column_called(table, reference, "--recordings", columns)
    columns |= apart
    chosen = named_by_person(answers.target, table, "--target", columns)
    columns |= chosen
    conditions, measured, unused = _conditions_of(study, table, answers, columns)
    # if a person names inputs, the target depends on them
    has_input = bool(conditions or measured or answers.inputs)
    ignored = ["time", *apart, *measured]
    targets = [*chosen] or _target_by_titles(table, answers, columns, ignored, has_input)
    if not targets:
        raise refuse_choice(table, study.files[0].name, path, study.layout.is_map)
    if answers.inputs is None:
        inputs = _free(table, columns, targets, left_out)
    else:
        in_names = {condition.quantity for condition in conditions}
        rest = {name: column for name, column in answers.inputs.items() if name not in in_names}
        driving = named_by_person(rest, table, "--inputs", columns)
        columns |= driving
        inputs = [name for name in driving if name not in ("time", *targets)]
    group, grouping = _group_of(table, answers.group, columns)
    columns |= grouping
    inputs = [name for name in inputs if name not in {*grouping, *apart}]
    if not inputs and not conditions and not is_driven:
        raise UsageError(
            f"{study.files[0].name}: no column is left that can be an input of a "
            f"model of {targets[0]}",
            "name the inputs with --inputs, or the quantity that was held constant with --hold; if "
            "each row holds the value of another quantity, first make a table with a column for "
            "each quantity",
        )
    used = dict.fromkeys(["time", *apart, *inputs, *targets, group])
    columns = {name: columns[name] for name in used if name in columns}
    return Understood(columns, targets, inputs, conditions, unused, left_out, group, [*apart])


def _columns_of(table: Table, answers: Answers) -> tuple[Named, dict[Column, str]]:
    """Return the columns of the study, and the reasons why other columns are left out. If a person
    lists columns, these are used; otherwise, columns whose titles identify a quantity. A column
    that looks like a clock is not used as the time if the person gives it another meaning.
    """
    if answers.columns:
        return named_by_person(answers.columns, table, "--columns", {}), {}
    columns, left_out = known_by_titles(table)
    named = {**answers.target, **(answers.inputs or {})}
    named.pop("time", None)
    clock = columns.get("time")
    if clock is not None and any(column.column == clock.column for column in _found(table, named)):
        del columns["time"]
    if answers.no_clock or answers.sample_time is not None:
        clock = columns.pop("time", None)
        left_out |= dict.fromkeys(
            clock.places if clock else (), "is not the clock, according to your options"
        )
    return columns, left_out


def _found(table: Table, named: Named) -> Iterator[TitledColumn]:
    """Yield the columns that a person names. A quantity whose values are in names of files has no
    column, and is left out.
    """
    for column in named.values():
        with suppress(UsageError):
            yield find(table, column.column, "")


def _conditions_of(
    study: FolderStudy, table: Table, answers: Answers, columns: Named
) -> tuple[list[NamedCondition], list[str], str]:
    """Return the quantities whose values stand in names of files, the names of the columns that
    measure such quantities, and a remark about the numbers in names that are not used. If a person
    names the inputs, a number without a unit is used only if the person names it. If a person does
    not name the inputs, a number that a column measures is used only if the person names it as the
    quantity that was held constant.
    """
    wanted = answers.inputs or {}
    renamed = [name for name, column in wanted.items() if not column.refers_to(name)]
    measured = [column.quantity for column in _found(table, wanted)]  # names of known quantities
    conditions, unused = told_by_names(study.names, answers.hold, [*columns, *renamed, *measured])
    needed = {*wanted, answers.hold.name if answers.hold else ""}
    read = {name: table[column.column] for name, column in columns.items()}
    measuring: list[str] = []
    reasons: dict[str, str] = {}
    for condition in conditions:
        name = None if answers.inputs is not None else _measured(condition, read)
        if condition.quantity in needed:
            continue
        if name is not None:
            measuring.append(name)
            reasons[condition.quantity] = f"the column {read[name].called} measures it"
        elif answers.inputs is not None and not condition.unit:
            reasons[condition.quantity] = "name it with --inputs to use it"
    conditions = [condition for condition in conditions if condition.quantity not in reasons]
    unused += [f"{quantity} ({why})" for quantity, why in reasons.items()]
    remark = f"numbers not used: {', '.join(dict.fromkeys(unused))}" if unused else ""
    return conditions, measuring, remark


def _measured(condition: NamedCondition, columns: Mapping[str, TitledColumn]) -> str | None:
    """Return the name of the column whose mean over each recording is a linear function of the
    number in the name of the recording, although the column varies far less within a recording than
    between two: the number is then the set point of what the column measures. If the number has a
    unit, the column must have a unit of the same dimension. If the number has none, the column must
    be no force and no position, because these may depend on the number. Return None if there is no
    such column.
    """
    numbers = np.array(some_of(condition.values))
    for name, column in columns.items():
        is_other = column.kind in ("force", "position")
        if condition.unit:
            is_other = not column.unit or not can_convert(column.unit, condition.unit)
        if (
            is_other
            or len(column.values) != len(numbers)
            or len(np.unique(numbers)) < FEWEST_SET_POINTS
        ):
            continue
        means = np.array([np.mean(x) for x in column.values])
        within = max(np.std(x) for x in column.values)
        gap = np.diff(np.sort(means)).max()
        if within < gap / 4 and abs(correlation(numbers, means)) > SAME_SET_POINT:
            return name
    return None


def _target_by_titles(
    table: Table, answers: Answers, columns: Named, ignored: Collection[str], has_input: bool
) -> list[str]:
    """Return a list with the quantity to predict, or an empty list if the titles leave a choice.
    If a person lists the columns, the names that the person gives are read instead of titles. The
    quantities in `ignored` are not predicted: the time, and what was set or counted.
    """
    titled = {} if answers.columns else table
    kinds = {
        name: kind_to_predict(name, titled.get(column.column))
        for name, column in columns.items()
        if name not in ignored
    }
    target = target_of(kinds, has_input)
    return [] if target is None else [target]


def _group_of(table: Table, reference: str | None, known: Named) -> tuple[str | None, Named]:
    """Return the name of the quantity that distinguishes groups, and its column; there is no column
    if groups are distinguished by a word in names of files.

    A column is given by its number, its title or its name. Raises UsageError for an unknown number.
    """
    known_columns = (column for column in table.values() if column.values or column.texts)
    titles = {text for column in known_columns for text in (column.title, column.name)}
    if reference is None or not (reference.isdecimal() or reference in titles):
        return reference, {}
    column = _column_called(table, reference, "--group", known)
    return next(iter(column)), column


def _column_called(table: Table, reference: str, option: str, known: Named) -> Named:
    """Find the column that a person calls by its number, its title or its name. Return it as the
    only entry of a mapping, by its name. Raises UsageError if there is no such column.
    """
    titled = find(table, address(reference), option, texts=True)
    names = {column.column: name for name, column in known.items()}
    name = names.get(titled.column, titled.name)
    return {name: known.get(name, titled.as_quantity(name))}


def _free(
    table: Table, columns: Named, targets: Sequence[str], left_out: dict[Column, str]
) -> list[str]:
    """Return the names of all columns that may be inputs. A column is left out, with a reason, in
    two cases: it is the same signal as a target; or a target was computed from it by a linear
    filter, and there are other inputs.
    """
    free = [
        name
        for name, column in columns.items()
        if name not in {"time", *targets} and not column.texts
    ]
    for target in targets:
        wanted = table[columns[target].column]
        for name in [*free]:
            candidate = table[columns[name].column]
            if candidate.kind not in ("", wanted.kind):
                continue
            is_copy = same_signals(
                [np.concatenate(series.values) for series in (candidate, wanted)]
            )
            if is_copy or (len(free) > 1 and _is_filtered(candidate.values, wanted.values)):
                free.remove(name)
                how = "is a linear function of" if is_copy else "gives, through a linear filter,"
                left_out[candidate.column] = f"{how} {target}; name it with --inputs to use it"
    return free


def _is_filtered(x: Sequence[Array], y: Sequence[Array]) -> bool:
    """Return True if `y[k] = a x[k] + b x[k-1] + c x[k-2] + d` up to 1e-4 of the range of y, so
    that y was computed from x.
    """
    pairs = list(zip(x, y, strict=True))
    if any(len(one) != len(other) or len(one) < FEWEST for one, other in pairs):
        return False
    rows = [np.column_stack([series[2:], series[1:-1], series[:-2]]) for series, _ in pairs]
    wanted = np.concatenate([other[2:] for _, other in pairs])
    design = np.column_stack([np.concatenate(rows), np.ones(len(wanted))])
    left = wanted - design @ np.linalg.lstsq(design, wanted, rcond=None)[0]
    return bool(np.abs(left).max() <= ROUNDING * np.ptp(wanted))
