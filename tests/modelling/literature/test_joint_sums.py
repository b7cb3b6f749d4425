"""Sums with signs and renamed inputs: what they say, formulas fitted together, and what such a sum
cannot tell apart.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from common import dataset_of
from hypothesis import given, settings
from hypothesis import strategies as st
from literature_cases import MUSCLE_LIKE, TABLE_I, muscle_like, uniform

from mapmore_cli.annexes.sums import Part, Sum, joint
from mapmore_cli.annexes.sums.fitted import SumMaker, _unit, behind_tendon, formula_parts
from mapmore_cli.annexes.sums.joint import (
    fit_jointly,
    joint_formula,
    refuse_shared_names,
    split,
    sum_of,
)
from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.domain.models import Formula, Model
from mapmore_cli.domain.recording import CurveRange, Quantity
from mapmore_cli.domain.results import FitResult, SimulatedRun
from mapmore_cli.modelling import kinds
from mapmore_cli.modelling.kinds import (
    equations,
    one_step_ahead,
    outside_range,
    predict,
    verbs_of,
)
from mapmore_cli.modelling.literature import get
from mapmore_cli.study.sections.model import Summand, TendonSettings

FORCE = Quantity("force", "N")


def summand(formula, sign=1, **inputs):
    return Summand(formula=formula, sign=sign, inputs=inputs)


PAIR = (
    summand("muscle_like", 1, pressure="p1", length="0.02 - x", velocity="v"),
    summand("muscle_like", -1, pressure="p2", length="0.02 + x", velocity="-v"),
)


def motion(seed, rows=800):
    return uniform(seed, rows, p1=(200, 600), p2=(200, 600), x=(-0.015, 0.015), v=(-0.3, 0.3))


def pair_force(columns):
    """H eq 4-5 for both muscles."""
    p1, p2, x, v = (columns[name] for name in ("p1", "p2", "x", "v"))
    return muscle_like(TABLE_I["16 cm"], p1, 0.02 - x, v) - muscle_like(
        TABLE_I["22 cm"], p2, 0.02 + x, -v
    )


def test_both_muscles_are_recovered_but_for_what_their_difference_does_not_show():
    """Two passive springs against each other are one: of the four parameters of both, the
    difference shows two combinations.
    """
    columns = motion(0)
    fit = fit_jointly(PAIR, columns, pair_force(columns))
    assert fit.name == "muscle_like - muscle_like"
    assert (fit.rank, fit.status) == (12, "rank_deficient")
    assert fit.sse < 1e-12 * np.sum(pair_force(columns) ** 2)
    for part, truth in zip(split(fit, PAIR), (TABLE_I["16 cm"], TABLE_I["22 cm"]), strict=True):
        assert [part.parameters[name] for name in MUSCLE_LIKE[:5]] == pytest.approx(
            truth[:5], rel=1e-4
        )
    dataset = dataset_of({**columns, "force": pair_force(columns)}, output="force")
    first, _ = formula_parts(PAIR, fit, dataset)
    assert first.model.input_names == ("length", "pressure", "velocity")
    told = " ".join(note for note in fit.notes if "not identified" in note)
    assert all(name in told for name in ("c0_1", "c1_1", "c0_2", "c1_2"))
    assert "b0_1" not in told
    later = motion(1)
    inputs = {
        f"{name}_{i}": x
        for i, part in enumerate(PAIR, 1)
        for name, x in joint.own_inputs(part, later).items()
    }
    assert joint_formula(PAIR).predict(fit.parameters, inputs) == pytest.approx(
        pair_force(later), abs=1e-6 * np.abs(pair_force(later)).max()
    )


@settings(max_examples=10)
@given(
    st.sampled_from(["sarosi", "polynomial_2", "chou_hannaford"]),
    st.integers(0, 999),
    st.sampled_from([1, -1]),
)
def test_a_joint_formula_is_the_signed_sum_of_its_parts(name, seed, sign):
    pair = (
        summand(name, 1, pressure="p1", strain="x"),
        summand(name, sign, pressure="p2", strain="0.1 - x"),
    )
    columns, rng = motion(seed, 20), np.random.default_rng(seed)
    formula = joint_formula(pair)
    values = {
        name: float(value)
        for name, value in zip(
            formula.parameters, rng.normal(size=len(formula.parameters)), strict=True
        )
    }
    whole = formula.predict(
        values,
        {
            f"{q}_{i}": x
            for i, one in enumerate(pair, 1)
            for q, x in joint.own_inputs(one, columns).items()
        },
    )
    parts = [
        get(name).predict(
            {p: values[f"{p}_{i}"] for p in get(name).parameters}, joint.own_inputs(one, columns)
        )
        for i, one in enumerate(pair, 1)
    ]
    assert whole == pytest.approx(
        parts[0] + sign * parts[1], rel=1e-9, abs=1e-9 * np.abs(parts).max()
    )


@pytest.mark.parametrize("name", ["sarosi_hinged", "tondu_lopez_fixed_area"])
def test_a_formula_with_a_fit_of_its_own_is_refused(name):
    with pytest.raises(SpecError, match=f"{name} cannot be fitted together with"):
        joint_formula((summand(name), summand("sarosi")))


def braid(name, c1):
    fit = FormulaFit(
        "chou_hannaford",
        {"c1": c1, "c2": 0.5},
        {"c1": 0.0, "c2": 0.0},
        "converged",
        "-",
        2,
        1.0,
        0.0,
        9,
    )
    ranges = (CurveRange("all", None, {"pressure": (0.0, 500.0), "strain": (-0.1, 0.2)}),)
    return Model(
        name,
        FORCE,
        (Quantity("pressure", "kPa"), Quantity("strain", "1")),
        Formula(fit, None, ranges),
        notes=("a braid",),
    )


def flexed():
    parts = [
        Part(braid("flexor", 2.0), 1.0, {"pressure": "p1", "strain": "s"}),
        Part(braid("extensor", 3.0), -1.0, {"pressure": "p2", "strain": "-s"}),
    ]
    return sum_of(
        "joint",
        parts,
        FORCE,
        {"p1": Quantity("p1", "kPa"), "p2": Quantity("p2", "kPa"), "s": Quantity("s", "1")},
    )


def test_a_sum_predicts_with_its_signs_and_its_renamed_inputs():
    columns = {
        "p1": np.array([300.0, 100.0]),
        "p2": np.array([200.0, 100.0]),
        "s": np.array([0.05, 0.0]),
    }
    by_hand = columns["p1"] * (2 * (1 - columns["s"]) ** 2 - 0.5) - columns["p2"] * (
        3 * (1 + columns["s"]) ** 2 - 0.5
    )
    assert predict(flexed(), columns) == pytest.approx(by_hand)
    assert one_step_ahead(flexed(), columns) == pytest.approx(by_hand)
    assert [quantity.name for quantity in flexed().inputs] == ["p1", "p2", "s"]


def test_the_range_of_each_part_is_looked_at_under_its_own_names():
    columns = {
        "p1": np.array([300.0, 600.0, 300.0, 300.0]),
        "p2": np.array([200.0] * 4),
        "s": np.array([0.05, 0.05, 0.15, -0.15]),
    }
    assert outside_range(flexed(), columns).tolist() == [False, True, True, True]


def test_a_part_that_feeds_another_has_a_range_as_well():
    valve = replace(braid("valve", 1.0), output=Quantity("pressure", "kPa"))
    fed = Part(braid("muscle", 2.0), fed=(Part(valve, 1.0, {"pressure": "v"}),))
    inputs = Quantity("v", "kPa"), Quantity("strain", "1")
    columns = {"v": np.array([300.0, 600.0]), "strain": np.array([0.05, 0.05])}
    model = Model("whole", FORCE, inputs, Sum((fed,)))
    behind = {"pressure": predict(valve, columns | {"pressure": columns["v"]})}
    np.testing.assert_allclose(predict(model, columns), predict(fed.model, columns | behind))
    assert outside_range(model, columns).tolist() == [False, True]


def test_the_equations_begin_with_what_is_added_up():
    first = equations(flexed())[0]
    assert first.text == "flexor(pressure = p1, strain = s) - extensor(pressure = p2, strain = -s)"
    assert first.latex.count("text{") >= 2
    assert flexed().notes == ("flexor: a braid", "extensor: a braid")


@pytest.mark.parametrize(
    ("parts", "shown"), [((1.0,), False), ((-1.0,), True), ((1.0, -1.0), True)]
)
def test_what_is_added_up_is_shown_unless_it_is_the_models_as_they_are(parts, shown):
    models = tuple(Part(braid(f"m{place}", 2.0), sign) for place, sign in enumerate(parts))
    whole = Model("whole", FORCE, models[0].model.inputs, Sum(models))
    assert (equations(whole)[0].id == "sum") == shown


def test_a_sum_diverges_in_the_rows_in_which_a_part_does(monkeypatch):
    rows = iter([(9, 1), (8, 1)])
    monkeypatch.setattr(kinds, "simulate", lambda _, x: SimulatedRun(x["strain"], next(rows)))
    columns = {"p1": np.zeros(10), "p2": np.zeros(10), "s": np.arange(10.0)}
    found = verbs_of(flexed()).simulate(flexed(), columns)
    assert found.diverged == (1, 8, 9)
    assert found.values.tolist() == [2.0 * row for row in range(10)]


def test_a_joint_formula_is_solved_as_a_linear_form_if_a_part_has_one():
    plain, formed = summand("sarosi", strain="0.1 - x"), PAIR[0]
    assert get("muscle_like").form is not None
    for parts, has_form in (((plain, plain), False), ((plain, formed), True)):
        assert (joint_formula(parts).form is not None) == has_form


ALONE, RENAMED = {}, {"pressure": "p1", "strain": "s"}


@pytest.mark.parametrize(
    ("first", "second", "shared"),
    [
        ({}, {}, "pressure"),  # the first of those that both have
        ({"pressure": "p1"}, {}, "pressure"),
        ({}, {"pressure": "p2"}, "pressure"),
        ({"pressure": "p1"}, {"pressure": "p2"}, "strain"),
        ({"strain": "s"}, {"strain": "s", "pressure": "p2"}, "pressure"),
        (RENAMED, RENAMED, None),
    ],
)
def test_an_input_of_two_parts_is_renamed_in_both(first, second, shared):
    names = ("pressure", "strain")
    parts = [("a", names, first), ("b", ("own", *names), second), ("c", ("load", "time"), {})]
    if shared is None:
        refuse_shared_names(parts)
    else:
        with pytest.raises(SpecError, match=f"a and b both have an input called `{shared}`"):
            refuse_shared_names(parts)


@pytest.mark.parametrize(
    ("inputs", "output", "quantities", "told"),
    [
        (ALONE, Quantity("force", "kN"), [], "in N, but the force of this study is in kN"),
        (ALONE, FORCE, [], "needs pressure in"),
        (
            RENAMED,
            FORCE,
            ["p1 bar", "s 1"],
            "needs pressure in kPa, but p1 of this study is in bar",
        ),
    ],
)
def test_another_unit_is_refused_and_an_input_that_is_lacking(inputs, output, quantities, told):
    known = {text.split()[0]: Quantity(*text.split()) for text in quantities}
    with pytest.raises(SpecError, match=told):
        sum_of("joint", [Part(braid("flexor", 2.0), 1.0, inputs)], output, known)


def test_inputs_of_a_sum_that_are_quantities_have_their_units():
    dataset = SimpleNamespace(unit={"p1": "kPa", "s": "mm"}.get)
    texts = ("p1", "-s", "0.1 - s", "2*s", "p1 + s", "-p1")
    assert [_unit(text, dataset) for text in texts] == ["kPa", "mm", "1", "1", "1", "kPa"]


def test_a_tendon_has_the_units_of_its_muscle():
    muscle = replace(braid("m", 2.0), output=Quantity("force", "kN"))
    assert behind_tendon(muscle, None) is muscle
    with pytest.raises(SpecError, match="m does not depend on `length`"):
        behind_tendon(muscle, SimpleNamespace(stiffness=2e6, force=50.0))
    long = replace(muscle, inputs=(Quantity("length", "mm"), *muscle.inputs))
    found = behind_tendon(long, SimpleNamespace(stiffness=2e6, force=50.0))
    assert (found.name, found.body.muscle) == ("m-behind-a-tendon", long)
    # 2e6 N/m are 2 kN/mm
    assert (found.body.stiffness, found.body.force) == (pytest.approx(2.0), pytest.approx(0.05))


def test_formulas_of_a_sum_are_models_of_their_own_inputs_with_signs_and_ranges():
    columns = {"p1": np.array([1.0, 3.0]), "x": np.array([0.0, 0.2]), "force": np.zeros(2)}
    pair = (
        summand("chou_hannaford", 1, pressure="p1", strain="x"),
        summand("chou_hannaford", -1, pressure="2*p1", strain="-x"),
    )
    numbers = {f"{name}_{i}": float(i) for name in ("c1", "c2") for i in (1, 2)}
    fit = FormulaFit("pair", numbers, numbers, "converged", "-", 4, 1.0, 0.0, 2)
    units = {"p1": "kPa", "x": "%", "force": "N"}
    dataset = dataset_of(columns, output="force")
    quantities = {name: Quantity(name, unit) for name, unit in units.items()}
    first, second = formula_parts(pair, fit, replace(dataset, quantities=quantities))
    assert [part.sign for part in (first, second)] == [1, -1]
    assert first.model.name == "chou_hannaford_1"
    assert second.model.body.fit.parameters == {"c1": 2.0, "c2": 2.0}
    assert [one.label for one in first.model.inputs] == ["pressure [kPa]", "strain [%]"]
    assert [one.unit for one in second.model.inputs] == ["1", "%"]
    (limits,) = second.model.body.ranges
    assert limits.limits == {"pressure": (2, 6), "strain": (-0.2, 0)}


def test_models_of_other_runs_are_added_with_their_inputs_signs_and_tendons():
    units = {"p1": "kPa", "p2": "kPa", "s": "1", "force": "N", "pressure": "kPa", "strain": "1"}
    quantities = {name: Quantity(name, unit) for name, unit in units.items()}
    runs = {"a.yaml": braid("flexor", 2.0), "b.yaml": braid("extensor", 3.0)}
    dataset = SimpleNamespace(target="force", quantities=quantities)
    given = SimpleNamespace(dataset=dataset, model_of=runs.get)

    def built(*summands, needed=()):
        part = SimpleNamespace(
            name="joint", model=SimpleNamespace(sum=summands or None), summands=needed
        )
        return SumMaker().build(part, given, FitResult(None))

    first = Summand(model="a.yaml", inputs={"pressure": "p1", "strain": "s"})
    second = Summand(model="b.yaml", sign=-1, inputs={"pressure": "p2", "strain": "-s"})
    assert built(first, second) == flexed()
    alone = built(needed=["a.yaml"])
    assert alone.body.parts == (Part(runs["a.yaml"]),)
    with pytest.raises(SpecError, match="both have an input called `strain`"):
        built(first, Summand(model="b.yaml", inputs={"pressure": "p2"}), first)
    with pytest.raises(SpecError, match="does not depend on `length`"):
        built(Summand(model="a.yaml", tendon=TendonSettings(stiffness=1000.0)), second)
