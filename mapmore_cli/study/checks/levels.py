"""Check settings that divide the data: segments, levels, groups, recordings, held-out data."""

from __future__ import annotations

import re
from collections.abc import Iterator

from mapmore_cli.domain.recording import DIRECTION
from mapmore_cli.modelling.pieces.recipe import CutByDirection, Cuts
from mapmore_cli.study.checks.remedies import DERIVED, OF_NOTHING
from mapmore_cli.study.diagnostics import Finding, applying
from mapmore_cli.study.experiment import ExperimentSpec
from mapmore_cli.study.sections.dictionary import entries_of, texts_in
from mapmore_cli.study.tree import Loc


def segmented(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that each segmented quantity can be cut as the spec says, and that the level quantity
    is not the target.
    """
    level = spec.data.levels.of if spec.data.levels else None
    has_terms = spec.model.type == "mapmore" and bool(spec.dictionary)
    interpolated = has_terms and spec.segment.get(level or "") != "none" and not spec.has_memory
    if level == spec.target_quantity and (interpolated or spec.model.type == "auto"):
        message = f"the levels are those of `{level}`, which is the target itself"
        remedy = f"{OF_NOTHING}: name a quantity that is held constant in each recording"
        yield Finding("data.levels.of", message, remedy)
    for name, cut in spec.segment.items():
        by_direction = isinstance(cut, CutByDirection)
        yield from applying(
            (
                name == spec.target_quantity,
                "segment.{name}:",
                "`{name}` is the target itself",
                f"{OF_NOTHING}: remove it",
            ),
            (
                cut == "levels" and name != level,
                "segment.{name}",
                "`{name}` has no levels, because it is not the quantity of `data.levels`",
                "add `levels: {{of: {name}}}` to `data`, or cut it with `method: even`",
            ),
            (
                isinstance(cut, Cuts) and name == level,
                "segment.{name}:",
                "`{name}` is constant within a curve, so that it cannot be cut",
                "remove it, or write `{name}: none` to pool all levels",
            ),
            (
                getattr(cut, "method", None) == "optimal" and not has_terms,
                "segment.{name}:",
                "`optimal` finds boundaries by fitting terms, and `{type}` has no terms",
                "use another `method`, or remove it",
            ),
            (
                by_direction and name != DIRECTION,
                "segment.{name}:",
                f"only `{DIRECTION}` can be cut into rise and fall, not `{{name}}`",
                f"write `{DIRECTION}` as its name",
            ),
            (
                by_direction and name in spec.data.quantities,
                "segment.{name}:",
                "`{name}` is already a quantity of the data",
                "rename the quantity, or write `{name}: {{method: breakpoints, at: [0]}}` here",
            ),
            name=name,
            type=spec.model.type,
        )


def leaving_out(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check a cross-validation: there must be levels or groups that can be left out, and it must be
    possible to fit the model without them.
    """
    data, whole = spec.data, spec.has_memory or spec.model.type == "sum"
    for way, example, there in (
        ("level", "pressure", data.levels is not None),
        ("group", "specimen", data.groups is not None),
    ):
        asked = getattr(data.split, f"leave_one_{way}_out")
        yield from applying(
            (
                asked and not there,
                "data.split.leave_one_{one}_out:",
                "there are no {one}s to leave out",
                "add `{one}s: {{of: {example}}}` to `data`",
            ),
            (
                asked and there and whole,
                "data.split.leave_one_{one}_out:",
                "a model with memory or a sum cannot be fitted with one of the {one}s left out",
                "hold out the end of recordings instead: `validate: {{last: 0.5}}`",
            ),
            one=way,
            example=example,
        )


def groups(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that a quantity distinguishes the groups, and that the gain and the offset of each
    group can be determined from the data.
    """
    groups, left_out = spec.data.groups, spec.data.split.leave_one_group_out
    if groups is None:
        return
    yield from applying(
        (
            groups.of not in spec.data.quantities,
            "data.groups.of",
            "no recording has the quantity `{of}`, by which the groups are formed",
            "add it to `columns`, or write `set: {{{of}: 1}}` beside the files",
        ),
        *(
            (
                left_out and getattr(groups, effect),
                f"data.groups.{effect}:",
                (f"the {effect} of a left-out group is not known, so that it cannot be predicted"),
                f"remove `{effect}` or `leave_one_group_out`",
            )
            for effect in ("offset", "gain")
        ),
        (
            groups.offset and spec.target in DERIVED,
            "data.groups.offset:",
            "the {target} force is a difference of two forces, in which an offset cancels",
            "remove `offset`",
        ),
        of=groups.of,
        target=spec.target,
    )


def recordings_apart(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that the quantities whose values distinguish recordings come from columns."""
    of = spec.data.recordings.quantities if spec.data.recordings is not None else []
    missing = [name for name in of if name not in spec.data.measured or name == "time"]
    yield from applying(
        (
            bool(missing),
            "data.recordings.of",
            "no column is called `{name}`; its value would separate the recordings",
            "add it to `columns`, for example `{name}: {{column: ...}}`",
        ),
        name=", ".join(missing),
    )


def after_cycles(spec: ExperimentSpec) -> Iterator[Finding]:
    """Refuse settings that need the time if `cycles` averages branches. The averaged samples are in
    the order of `cycles.over`, so that they have no time.
    """
    cycles, hold_out = spec.data.cycles, spec.data.split.hold_out
    if cycles is None:
        return
    held = hold_out is not None and "time" in hold_out.quantities
    uses: list[tuple[bool, Loc | str]] = [
        ("time" in spec.segment, "segment.time:"),
        (held, "data.split.validate.time:"),
    ]
    for loc, _, family in entries_of(spec.dictionary):
        uses += [
            (re.search(r"\btime\b", text) is not None, at) for at, text, _ in texts_in(loc, family)
        ]
    fault = "`cycles` sorts the samples by `{over}`, so that they have no `time` any more"
    remedy = "use `{over}` instead, or remove `cycles`"
    yield from applying(*((*use, fault, remedy) for use in uses), over=cycles.over)


def chosen_levels(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check the values of the level quantity in `split.validate` and `fit.train_level`: each must
    be a level of the data.
    """
    levels, hold_out, trains = spec.data.levels, spec.data.split.hold_out, spec.fit.train_level
    if levels is None:
        fault = "the data have no levels, so that none can be chosen"
        yield from applying((trains != "all", "fit.train_level:", fault, "add `levels` to `data`"))
    elif not isinstance(levels.at, str):
        values = hold_out.quantities.get(levels.of) if hold_out is not None else None
        reach = levels.within or (levels.spacing or 0) / 2
        asked: list[tuple[Loc, object, float]] = [(("fit", "train_level"), trains, 0.0)]
        for i, value in enumerate(values if isinstance(values, list) else ()):
            asked.append((("data", "split", "validate", levels.of, i), value, reach))
        known = f"the levels are {', '.join(f'{level:g}' for level in levels.at)}"
        for loc, level, off in asked:
            if isinstance(level, float) and min(abs(level - at) for at in levels.at) > off:
                yield Finding(loc, f"{level:g} is not a level of `{levels.of}`", known)
