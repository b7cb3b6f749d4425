"""Check that the study has everything that its target and its kind of model need."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import inf
from operator import attrgetter
from typing import Protocol, get_args, runtime_checkable

from mapmore_cli.modelling.kinds import kinds
from mapmore_cli.modelling.pieces.recipe import Cuts
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.study.checks.remedies import STATIC_RUN
from mapmore_cli.study.diagnostics import Finding, applying
from mapmore_cli.study.experiment import ExperimentSpec, TargetColumn
from mapmore_cli.study.fields import TargetKind
from mapmore_cli.study.sections.data import STEP_OF
from mapmore_cli.study.sections.dictionary import feeds_back
from mapmore_cli.study.units import default_unit, is_same

MOTION = ("damping", "dynamic")
"""Targets that have a static and a damping part."""


def target(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that everything exists from which the target is computed: its quantity, load cycles,
    plateaus, or the runs in `needs`.
    """
    needs, plateau, have = spec.needs, spec.data.plateau, spec.data.quantities
    missing = [f"`needs.{name}`" for name in ("static", "damping") if getattr(needs, name) is None]
    low, high = plateau if isinstance(plateau, tuple) else (-inf, inf)
    yield from applying(
        (
            isinstance(spec.target, str) and spec.target_quantity not in have,
            "target",
            "target `{target}` needs the quantity `{quantity}`",
            "add `{quantity}` to `columns`",
        ),
        (
            spec.target == "hysteresis" and spec.data.cycles is None,
            "target",
            "target `hysteresis` needs load cycles",
            "add `cycles: {{over: strain}}` to `data`",
        ),
        (
            spec.target == "damping" and needs.static is None,
            "target",
            "target `damping` needs a static model",
            STATIC_RUN,
        ),
        (
            spec.target == "damping" and plateau is None,
            "target",
            "target `damping` needs the plateau of each step response",
            "add `plateau: auto` to `data`, or `plateau: [2 s, 3 s]`",
        ),
        (
            spec.model.type == "sum" and spec.model.sum is None and bool(missing),
            "target",
            f"the sum of two models needs {' and '.join(missing)}",
            "add `needs: {{static: my-static.yaml, damping: my-damping.yaml}}`",
        ),
        *(
            (
                plateau is not None and name not in have,
                "data.plateau:",
                f"`plateau` needs the quantity `{name}`",
                f"add `{name}` to `columns`",
            )
            for name in ("time", STEP_OF)
        ),
        (
            low >= high,
            "data.plateau",
            f"the plateau must begin before it ends, but goes from {low:g} s to {high:g} s",
            "put the earlier time first",
        ),
        target=spec.target,
        quantity=spec.target_quantity,
    )


OF_ONE = (
    *("model.backbone", "data.cycles", "data.groups", "fit.shape", "fit.ridge", "fit.scale"),
    *("data.split.leave_one_level_out", "data.split.leave_one_group_out"),
    *("validate.as", "validate.intervals"),
)
"""Settings that apply to one target only."""

HELD = {
    "fit.scale": "fit.known_scale",
    "validate.as": "validation.as_",
    "validate.intervals": "validation.intervals",
}
"""Attribute of the spec that holds a setting, for settings whose attribute has another name."""


def several(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that a spec with several targets models them by pieces, or by terms with memory of the
    inputs only.
    """
    if not spec.also:
        return
    names = spec.targets
    alone = f"write a separate spec for each of {', '.join(names)}"
    if spec.model.type == "auto":
        yield Finding(
            "target",
            "the structure search works for one target only, and this spec has several targets",
            f"write a `dictionary`, from which all targets get the same terms; or {alone}",
        )
    ways = [way for way in OF_ONE if attrgetter(HELD.get(way, way))(spec)]
    ways += ["model.type"] * (spec.model.type not in ("mapmore", "auto"))
    ways += ["fit.stop"] * (spec.fit.stop == "free_run")
    wrong = [(way, f"`{way.split('.')[-1]}` works for one target only") for way in ways]
    for name, cut in spec.segment.items():
        if isinstance(cut, Cuts) and cut.method == "gradient":
            wrong.append((f"segment.{name}", "`gradient` works for one target only"))
    for i, entry in enumerate(spec.dictionary):
        if entry.bounded:
            wrong.append((f"dictionary.{i}", "`sign` and `bounds` work for one target only"))
        wrong += [
            (
                f"dictionary.{i}",
                f"a term contains the target `{name}`, and only terms of inputs can be shared",
            )
            for name in names
            if feeds_back([entry], name)
        ]
    for name in dict.fromkeys(names):
        if names.count(name) > 1:
            wrong.append(("target", f"`{name}` is named twice"))
        if name in get_args(TargetKind):
            wrong.append(("target", f"`{name}` is a component of one target"))
    for way, fault in wrong:
        yield Finding(way, f"{fault}, and this spec has several targets", alone)


def kind(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that the spec has all settings that the kind of model needs, and that the model can be
    inverted if `validate.as` asks for it.
    """
    model, scored_as, is_pieces = spec.model, spec.validation.as_, spec.model.type == "mapmore"
    family = () if model.family is None else ("pressure", "strain", model.family.of)
    tries_fits = any(getattr(cut, "method", None) == "optimal" for cut in spec.segment.values())
    is_own = not isinstance(spec.target, TargetColumn) or scored_as == spec.target.column
    for name in family:
        yield from applying(
            (
                name not in spec.data.quantities,
                "model.family:",
                "a family needs the quantity `{name}`",
                "add `{name}` to `columns`, or `set` it beside the files",
            ),
            name=name,
        )
    weighed = [key for key in ("loss", "weight") if key in spec.fit.changed]
    yield from applying(
        (
            bool(family) and not is_same(default_unit("strain", spec.units), "1"),
            "model.family:",
            "a family needs the strain as a fraction, but `units` sets another unit for it",
            "remove `strain` from `units`",
        ),
        *(
            (
                not is_pieces,
                f"fit.{key}",
                (
                    "`{type}` is fitted by ordinary least squares, in which all samples count "
                    "the same"
                ),
                "remove it, or fit terms of a `dictionary`",
            )
            for key in weighed[:1]
        ),
        (
            model.backbone == AUTO and spec.has_memory,
            "model.backbone",
            "`auto` chooses by leaving out levels or blocks, which is not possible with memory",
            "name a formula, for example `sarosi`",
        ),
        (
            model.backbone == AUTO and tries_fits and not spec.has_memory,
            "model.backbone",
            "`auto` needs given segments, but `optimal` segments depend on the backbone",
            "name a formula, for example `sarosi`, or cut with `method: even`",
        ),
        (
            scored_as is not None and is_own,
            "validate.as",
            "`as: {scored_as}` needs a model of another quantity, which is then inverted",
            "set `target: {{column: strain}}`, or remove `as`",
        ),
        (
            scored_as is not None and not is_own and (spec.has_memory or not is_pieces),
            "validate.as",
            "only a model of segments can be inverted for the scores",
            "remove `as`",
        ),
        type=model.type,
        scored_as=scored_as,
    )


@runtime_checkable
class CheckedKind(Protocol):
    """A kind of model that a plugin adds, with its own check of the spec."""

    def findings(self, spec: ExperimentSpec) -> Iterable[Finding]:
        """Return the faults of a spec. Return nothing if its model is not of this kind."""


def of_kinds(spec: ExperimentSpec) -> Iterator[Finding]:
    """Run the checks of the spec that plugins with kinds of models define."""
    for kind_of_model in kinds():
        if isinstance(kind_of_model, CheckedKind):
            yield from kind_of_model.findings(spec)
