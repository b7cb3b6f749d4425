"""Documents that must load, and what they then say."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from common import rows_of
from spec_examples import (
    DAMPING,
    FORCE,
    GOOD,
    LOGS,
    MEASURED,
    MOTION,
    MOVING,
    SHIPPED,
    STATIC,
    assert_says,
    load_text,
)

from mapmore_cli.fitting.kinds.choices import model_choices
from mapmore_cli.fitting.kinds.dictionary import signals_of, units_of
from mapmore_cli.fitting.kinds.pieces import recipe_of
from mapmore_cli.pipeline.stages import segment_slice
from mapmore_cli.study.loader import load


def test_the_static_study(tmp_path):
    loaded = load_text(tmp_path, STATIC)
    assert_says(
        loaded.spec,
        """
muscle: {length: 0.088, diameter: 0.02}
data:
  levels: {of: pressure, at: [80, 150, 250, 350]}
  split: {validate: {pressure: [250]}}
segment: {strain: {method: even, count: 4}}
fit: {tolerance: 0.0001}
validate: {require: {nrmse: 0.05}}
""",
    )
    assert loaded.spec.data.quantities == ("time", "pressure", "strain", "force")
    assert loaded.spec.target_quantity == "force"
    assert (loaded.path, loaded.folder) == (tmp_path / "spec.yaml", tmp_path)


def test_a_quantity_without_a_canonical_name_is_in_the_unit_of_its_column(tmp_path):
    heated = STATIC.replace(
        "force:    {",
        "heat: {column: T, unit: degC}\n    share: {column: w, unit: '%'}\n    force:    {",
    )
    assert load_text(tmp_path, heated).spec.units == {"heat": "degC"}
    said = heated.replace("target: static", "units: {heat: K}\ntarget: static")
    assert load_text(tmp_path, said).spec.units == {"heat": "K"}


def test_a_target_by_its_name_alone_is_that_of_a_quantity(tmp_path):
    named, told = (
        load_text(tmp_path, MOTION.replace("target: {column: displacement}", f"target: {target}"))
        for target in ("displacement", "{column: displacement}")
    )
    assert named.spec == told.spec
    assert named.resolved == told.resolved
    assert named.spec.target_quantity == "displacement"


def test_numbers_with_units_are_in_the_units_of_the_model(tmp_path):
    """An offset is in the unit of its column; the speed is a rate, whose unit is m/s."""
    assert_says(
        load_text(tmp_path, MEASURED).spec,
        """
data:
  files:
    - {path: "10mm_Unkink_*.csv.gz", set: {length: 0.182}}
    - {path: "10mm_kinked25_*.csv.gz", set: {length: 0.1745}, id: kinked,
        keep: [{quantity: time, outside: [60, 70]}]}
    - plain.csv
  columns: {force: {offset: 0.009}, pressure: {offset: 14.503773773}}
  derive: {pressure_rate: {rate_of: pressure, window: 0.03, order: 2}}
  keep: [{abs_below: 0.25}, {between: [40, 900]}, {below: 0.005}]
  levels: {of: strain, at: [0, 0.04, 0.08], within: 0.01}
  split: {validate: {strain: [0.04], pressure: {between: [[2, 2.6], [4, 4.6]]}, fraction: 0.25}}
segment: {pressure: {method: breakpoints, at: [1, 2]}}
fuse: {extrapolation: {strain: {below: 0.01, above: saturate}, pressure: continue_linear}}
validate:
  against: [sarosi, {model: sarosi, method: levenberg_marquardt, as: sarosi_lm}]
  require: {rmse: 0.005, nrmse: 0.05, r2: 0.9}
report: {published: {nrmse: {sarosi: 0.025}}}
""",
    )


def test_logs_in_their_dialects(tmp_path):
    spec = load_text(tmp_path, LOGS).spec
    assert_says(
        spec,
        """
data:
  header: 2
  skip_rows: 1
  delimiter: ;
  decimal: ","
  encoding: latin-1
  join:
    - {shift: -40.2, max_gap: 0.1, root: "train[*]", header: true,
        columns: {pressure: {offset: 14.503773773}}}
    - {"on": row, sheet: Run1}
  gaps: {longer_than: 0.01, action: split}
  resample: 0.0005
""",
    )
    assert spec.data.join[1].quantities == ("strain",)
    assert spec.data.quantities == ("time", "force", "pressure", "strain")


@pytest.mark.parametrize(
    "study", [*GOOD.values(), *SHIPPED], ids=[*GOOD, *(path.stem for path in SHIPPED)]
)
def test_the_resolved_text_loads_to_the_same_spec(tmp_path, study):
    loaded = load(study) if isinstance(study, Path) else load_text(tmp_path, study)
    again = load_text(tmp_path, loaded.resolved)
    assert again.spec == loaded.spec
    assert isinstance(study, Path) or again.resolved == loaded.resolved


@pytest.mark.parametrize(
    ("old", "new"),
    [
        *rows_of("""
target: static                        target: hysteresis
at: [80, 150, 250, 350]               at: auto
at: [80, 150, 250, 350]               at: [0.8 bar, 1.5 bar, 250, 350000 Pa], within: 35
split: {validate: {pressure: [250]}}  split: {leave_one_level_out: true}
split: {validate: {pressure: [250]}}  split: {validate: {recordings: [load_cycle_150]}}
split: {validate: {pressure: [250]}}  split: {validate: {last: 50 %}}
{pressure: [250]}                     {pressure: [285]}
{pressure: [250]}                     {pressure: {between: [[250, 250]]}}
against: [sarosi, polynomial_2]       against: []
samples: 200}                         samples: 0x20}
"""),
        (
            "segment:\n  strain: {method: even, count: 4}",
            "segment: {pressure: none, strain: {method: even, count: 1}}",
        ),
        ("segment:\n  strain: {method: even, count: 4}", "segment: {pressure: levels}"),
        ("- polynomial", "- bounds: [2, 2]\n    polynomial"),  # a coefficient that is known
    ],
)
def test_variants_of_the_static_study_load(tmp_path, old, new):
    assert old in STATIC
    load_text(tmp_path, STATIC.replace(old, new))


EVEN = "{method: even, count: 4}"
DYNAMIC = DAMPING.replace("target: damping", "target: dynamic").replace(
    "needs: {static: dmsp-20-88-static.yaml}", "needs: {static: s.yaml, damping: d.yaml}"
)
DYNAMIC = DYNAMIC[: DYNAMIC.index("dictionary")] + DYNAMIC[DYNAMIC.index("validate: {against") :]


FIT = "fit: {max_terms: 4, ridge: auto, forward: 12}"
UNSAID = STATIC.replace(", max_terms: 1, tolerance: 1.0e-4", "")


@pytest.mark.parametrize(
    ("text", "terms", "stop"),
    [
        (MOTION.replace(FIT, ""), 12, "bic"),
        (MOTION.replace(FIT, "fit: {max_terms: 3, loss: huber}"), 3, "tolerance"),
        (MOTION.replace(FIT, "fit: {stop: press}"), 12, "press"),
        (MOTION.replace(FIT, "fit: {tolerance: 0.01}"), 12, "tolerance"),
        (UNSAID, 1, "tolerance"),
        (UNSAID.replace("strain: {method: even, count: 4}", "pressure: none"), 12, "bic"),
        (UNSAID.replace("  strain: {m", "  pressure: none\n  strain: {m"), 1, "tolerance"),
        (UNSAID.replace("segment:\n  strain: {method: even, count: 4}\n", ""), 1, "tolerance"),
    ],
)
def test_one_model_of_everything_has_as_many_terms_as_data_support(tmp_path, text, terms, stop):
    fit = load_text(tmp_path, text).spec.fit
    assert (fit.max_terms, fit.stop) == (terms, stop)


def test_a_model_without_segments_may_have_a_constant_among_its_terms(tmp_path):
    polynomial = "polynomial: {of: [pressure, strain], order: 2}"
    spec = load_text(tmp_path, FORCE.replace(polynomial, "terms: ['1', strain]")).spec
    assert spec.dictionary[0].terms == ["1", "strain"]


def test_the_resolved_text_has_the_defaults_and_no_empty_keys(tmp_path):
    text = load_text(tmp_path, FORCE).resolved
    assert yaml.safe_load(text)["fuse"]["z_s"] == 0.25
    assert "null" not in text


@pytest.mark.parametrize(("text", "over_time"), [(MOTION, True), (FORCE, False), (MOVING, True)])
def test_a_model_runs_over_time_if_it_has_memory_or_is_of_motion(tmp_path, text, over_time):
    assert load_text(tmp_path, text).spec.runs_over_time is over_time


def test_the_damping_example(tmp_path):
    spec = load_text(tmp_path, DAMPING).spec
    assert (spec.fit.scaling, load_text(tmp_path, MOTION).spec.fit.scaling) == ("max_abs", "none")
    assert spec.validation.against[-1].label == "sarosi+reynolds"
    assert units_of(spec)["step_pressure"] == "kPa"
    names = [signal.name for signal in signals_of(spec)]
    assert names == ["strain_rate", "pressure_rate", "direction"]


def test_a_damping_study_without_segments_is_scaled_as_with_segments(tmp_path):
    cut = "direction: {of: pressure_rate, dead_band: 5 kPa/s},\n    "
    pooled = DAMPING[: DAMPING.index("fit:")].replace(cut, "")
    fit = load_text(tmp_path, pooled).spec.fit
    assert (fit.scaling, fit.max_terms) == ("max_abs", 12)


def test_the_structure_of_a_damping_model_can_be_searched(tmp_path):
    text = DAMPING[: DAMPING.index("segment:")]
    assert load_text(tmp_path, text).spec.model.type == "auto"


def test_numbers_of_motion_carry_units(tmp_path):
    text = (
        DAMPING.replace("5 kPa/s", "0.05 bar/s")
        .replace("plateau: auto", "plateau: [900 ms, 2 s]")
        .replace("highest", "3.5 bar")
        .replace("[80, 150, 250, 350]", "[0.8 bar, 150, 250, 350]")
    )
    assert_says(
        load_text(tmp_path, text).spec,
        """
data: {plateau: [0.9, 2], levels: {at: [80, 150, 250, 350]}}
segment: {direction: {of: pressure_rate, dead_band: 5}}
fit: {train_level: 350}
""",
    )


def test_a_sum_is_the_default_of_a_dynamic_target_without_a_dictionary(tmp_path):
    assert load_text(tmp_path, DYNAMIC).spec.model.type == "sum"
    direct = DAMPING.replace("target: damping", "target: dynamic")
    assert load_text(tmp_path, direct).spec.model.type == "mapmore"


def test_weights_between_step_pressures_go_by_the_pressure(tmp_path):
    spec = load_text(
        tmp_path, DAMPING.replace("step_pressure: none}", "step_pressure: levels}")
    ).spec
    assert recipe_of("damping", model_choices(spec)).level == "pressure"


def test_segments_depend_on_the_fit_only_where_boundaries_try_it(tmp_path):
    """A change of `fit` must not cut the curves anew, unless boundaries are optimal for that
    fit.
    """
    more_terms = STATIC.replace("max_terms: 1", "max_terms: 2")
    optimal = "{method: optimal, count: 4}"
    assert segment_slice(load_text(tmp_path, STATIC).spec) == segment_slice(
        load_text(tmp_path, more_terms).spec
    )
    tried = (
        segment_slice(load_text(tmp_path, text.replace(EVEN, optimal)).spec)
        for text in (STATIC, more_terms)
    )
    assert next(tried) != next(tried)
