"""Units with a zero of their own: temperatures, and absolute pressures.

A number of the spec is a value of its quantity (`at: 20 degC` is 293.15 K) or a difference of two
(`within: 5 degC` is 5 K). The tables below say by hand which is which, for every key whose unit
depends on the spec.
"""

from contextlib import suppress
from itertools import pairwise, permutations

import pytest
import yaml
from spec_examples import load_text

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.study.schema import json_schema

# each unit as `factor * number + zero` in K, or in kPa above vacuum
TEMPERATURES = {"K": (1, 0), "degC": (1, 273.15), "degF": (5 / 9, 459.67 * 5 / 9)}
PSI, AIR = 0.45359237 * 9.80665 / 0.0254**2 / 1000, 101.325
PRESSURES = {
    "kPa": (1, AIR), "psia": (PSI, 0), "bar(a)": (100, 0), "Pa abs": (1e-3, 0), "psi": (PSI, AIR),
}  # fmt: skip

STUDY = """\
name: heat
units: {{heat: {unit}, cold: {unit}, warm: {unit}}}
data:
  files: [{{path: a.csv, set: {{heat: {number}}}}}]
  columns:
    warm: {{column: w, offset: {number}}}
    time: {{column: t}}
    cold: {{column: c, unit: {unit}, offset: {number}}}
    heat: {{column: T}}
  uncertainty: {{heat: {number}}}
  derive:
    way: {{direction_of: heat, dead_band: {number}}}
  keep:
    - {{quantity: heat, abs_below: {number}}}
    - {{quantity: heat, below: {number}}}
    - {{quantity: heat, above: {number}}}
    - {{quantity: heat, between: [{number}, 1.0e+9]}}
    - {{quantity: heat, outside: [-1.0e+9, {number}]}}
  levels: {{of: heat, at: [{number}], within: {number}}}
  split: {{validate: {{heat: {{between: [[{number}, 1.0e+9]]}}, cold: [{number}]}}}}
target: warm
segment: {{cold: {{method: breakpoints, at: [{number}]}},
  direction: {{of: heat, dead_band: {number}}}}}
dictionary: [{{polynomial: {{of: [cold], order: 1}}, bounds: [-1.0e+9, {number}]}}]
fit: {{train_level: {number}}}
fuse: {{extrapolation: {{cold: {{below: {number}, above: {number}}}}}}}
report: {{published: {{source: us, rmse: {{us: {number}}}, rmse_at_least: {{we: {number}}}}}}}
"""
MOTION = """\
name: motion
units: {{heat: {unit}}}
data: {{files: [a.csv], columns: {{time: {{column: t}}, heat: {{column: T}}, tip: {{column: x}}}}}}
target: tip
model: {{type: state_space, input: heat, sections: [{number}], direction: true,
  switching: bumpless, dead_band: {number}}}
"""
ROBUST = """\
name: robust
units: {{heat: {unit}}}
data:
  files: [a.csv]
  columns: {{pressure: {{column: p}}, strain: {{column: s}}, heat: {{column: T}}}}
  levels: {{of: pressure}}
target: heat
dictionary: [{{polynomial: {{of: [strain], order: 2}}}}]
fit: {{loss: huber, scale: {number}}}
validate: {{require: {{rmse: {number}, normaliser: {number}}}}}
"""
SEVERAL = """\
name: several
units: {{heat: {unit}}}
data: {{files: [a.csv], columns: {{force: {{column: F}}, heat: {{column: T}}, tip: {{column: x}}}}}}
target: [heat, tip]
dictionary: [{{polynomial: {{of: [force], order: 1}}}}]
validate: {{require: {{max_abs_error: {{heat: {number}, tip: 1}}}}}}
"""
DIFFERENCES = {
    "SourceColumn.offset": "data.columns.cold.offset",
    "Data.uncertainty": "data.uncertainty.heat",
    "Direction.dead_band": "data.derive.way.dead_band",
    "Keep.abs_below": "data.keep.0.abs_below",
    "Levels.within": "data.levels.within",
    "CutByDirection.dead_band": "segment.direction.dead_band",
    "DictionaryEntry.bounds": "dictionary.0.bounds.1",
    "Fit.scale": "fit.scale",
    "Validate.require": "validate.require.rmse",
    "PublishedScores.rmse": "report.published.rmse.us",
    "PublishedScores.rmse_at_least": "report.published.rmse_at_least.we",
    "ModelChoice.dead_band": "model.dead_band",
}
VALUES = {
    "FileEntry.set": "data.files.0.set.heat",
    "Keep.below": "data.keep.1.below",
    "Keep.above": "data.keep.2.above",
    "Keep.between": "data.keep.3.between.0",
    "Keep.outside": "data.keep.4.outside.1",
    "Levels.at": "data.levels.at.0",
    "Between.between": "data.split.validate.heat.between.0.0",
    "Holdout.additionalProperties": "data.split.validate.cold.0",
    "Cuts.at": "segment.cold.at.0",
    "Fit.train_level": "fit.train_level",
    "BelowAbove.below": "fuse.extrapolation.cold.below",
    "BelowAbove.above": "fuse.extrapolation.cold.above",
    "ModelChoice.sections": "model.sections.0",
}
MORE = (
    "data.columns.warm.offset",
    "validate.require.max_abs_error.heat",
    "validate.require.normaliser",
)


def quantities(schema, place=()):
    """The keys whose numbers are in the unit of something else, with what is said of it."""
    if isinstance(unit := schema.get("unit"), str) and unit.startswith("that of"):
        yield ".".join(step for step in place if step not in ("$defs", "properties")), unit
    for step, inner in schema.items():
        for part in inner if isinstance(inner, list) else [inner]:
            if isinstance(part, dict):
                yield from quantities(part, (*place, step))


def test_every_key_with_a_unit_is_known_as_a_value_or_as_a_difference():
    said = dict(quantities(json_schema()))
    said = {".".join(key.split(".")[:2]): unit for key, unit in said.items()}
    assert said.keys() == DIFFERENCES.keys() | VALUES.keys()
    assert {key for key, unit in said.items() if unit.endswith(", as a difference")} == {
        *DIFFERENCES
    }


def value_at(tree, place):
    """What stands at a place, None where it does not exist."""
    with suppress(KeyError, IndexError, TypeError):
        for step in place.split("."):
            tree = tree[int(step) if isinstance(tree, list) else step]
        return tree


PAIRS = [(TEMPERATURES, *pair) for pair in permutations(TEMPERATURES, 2)]
PAIRS += [(PRESSURES, *pair) for pair in pairwise([*PRESSURES, "kPa"])]


@pytest.mark.parametrize(("of", "unit", "written"), PAIRS)
def test_a_difference_does_not_depend_on_where_the_zero_of_its_unit_lies(
    tmp_path, of, unit, written
):
    (factor, zero), (own_factor, own_zero) = of[unit], of[written]
    expected = dict.fromkeys((*DIFFERENCES.values(), *MORE), 500 * own_factor / factor)
    value = (500 * own_factor + own_zero - zero) / factor
    expected |= dict.fromkeys(VALUES.values(), value)
    met = set()
    for text in (STUDY, MOTION, ROBUST, SEVERAL):
        written_spec = text.format(unit=unit, number=f"500 {written}")
        loaded = load_text(tmp_path, written_spec)
        resolved = yaml.safe_load(loaded.resolved_in(tmp_path, given_only=True))
        for place, number in expected.items():
            if (found := value_at(resolved, place)) is not None:
                met.add(place)
                assert found == pytest.approx(number, rel=1e-12), place
    assert met == {*expected}


def test_equations_are_not_printed_in_a_unit_with_another_zero(tmp_path):
    text = SEVERAL.format(unit="K", number=1) + "report: {units: {heat: UNIT}}\n"
    assert load_text(tmp_path, text.replace("UNIT", "mK"))
    with pytest.raises(SpecError, match="the zero of `degC` differs from the zero of `K`"):
        load_text(tmp_path, text.replace("UNIT", "degC"))
