"""Sections of a spec, made from their values: what the code reads of them, by hand."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
from pydantic import ValidationError

from mapmore_cli.modelling.literature.own import formula_of
from mapmore_cli.study import campaign as campaigns
from mapmore_cli.study.checks.terms import clocks, expression_findings
from mapmore_cli.study.experiment import ExperimentSpec, _given_memory
from mapmore_cli.study.fields import Section, possible_path
from mapmore_cli.study.sections.data import Data, Levels, MissingRule
from mapmore_cli.study.sections.dictionary import (
    DictionaryEntry,
    Spline,
    remembers,
    texts_in,
    timed_terms,
)
from mapmore_cli.study.sections.logs import Logs, SourceColumn
from mapmore_cli.study.sections.model import OwnFormula
from mapmore_cli.study.sections.results import Competitor
from mapmore_cli.study.sections.split import Apart, Groups, Split


def test_a_clock_in_parts_has_stamps_and_numbers_with_units():
    stamps = SourceColumn(columns=["date", "h", "f"], format=["%Y-%m-%d", "%H", "ms"])
    assert stamps.places == ["date", "h", "f"]
    assert stamps.formats == {"date": "%Y-%m-%d"}
    assert stamps.units_of_parts == {"date": "s", "h": "h", "f": "ms"}
    numbers = SourceColumn(columns=[0, 1, 2], format="%H %M %S")
    assert (numbers.formats, numbers.units_of_parts) == ({}, {0: "h", 1: "min", 2: "s"})
    alone = SourceColumn(column="t", format="%H:%M")
    assert (alone.places, alone.formats) == (["t"], {"t": "%H:%M"})
    assert SourceColumn(column="t").formats == {}


def test_a_column_that_two_quantities_share_is_no_clock():
    clock = SourceColumn(columns=["date", "t"], format="%Y-%m-%d s")
    columns = {"time": clock, "x": SourceColumn(column="t")}
    logs = Logs.model_construct(columns=columns)
    assert logs.clocks() == {"date"}


def test_missing_values_are_texts_without_spaces_and_numbers():
    rule = MissingRule(tokens=[" no signal", "-", -999.0, 0.0])
    assert (rule.texts, rule.numbers) == ({"no signal", "-"}, (-999.0, 0.0))


def test_what_is_computed_from_a_quantity_also_through_others():
    columns = {"x": SourceColumn(column=0), "y": SourceColumn(column=1)}
    rate = {"rate_of": "a", "window": 0.1}
    derive = {"a": "x + 1", "b": rate, "c": "b*y", "d": "2*y"}
    data = Data(files=["a.csv"], columns=columns, derive=derive)
    assert data.computed_from("x") == {"a", "b", "c"}
    assert data.computed_from("y", "a") == {"b", "c", "d"}
    assert data.computed_from("d") == set()


@pytest.mark.parametrize(
    ("at", "spacing"), [("auto", None), ([2.0], None), ([3.0, 1.0], 2.0), ([3.0, 1.0, 2.5], 0.5)]
)
def test_levels_are_apart_by_the_smallest_distance(at, spacing):
    assert Levels(of="p", at=at).spacing == spacing


def test_an_own_formula_computes_in_its_units():
    """With 2 N per bar, 100 kPa are 2 N."""
    own = OwnFormula(name="own", expression="a*p", units={"p": "bar"}, parameters={"a": {}})
    made = formula_of(own.definition({"p": "kPa"}))
    assert made.predict({"a": 2.0}, {"p": np.array([100.0])}) == pytest.approx([2])
    assert made.reference == "the spec"
    assert "me" in formula_of(own.model_copy(update={"source": "me"}).definition({})).reference


@pytest.mark.parametrize(
    ("settings", "label"),
    [
        ({"model": "sarosi"}, "sarosi"),
        ({"model": "sarosi", "as": "a"}, "a"),
        ({"static": "sarosi", "damping": "none"}, "sarosi+none"),
        ({"run": "other/o.yaml"}, "o"),
    ],
)
def test_a_competitor_has_its_name_or_that_of_what_it_is(settings, label):
    assert Competitor.model_validate(settings).label == label


def test_paths_are_as_long_as_a_file_system_allows():
    for path in ("a/" + 255 * "b", 1999 * "a/" + "bb", "é" * 127):
        assert possible_path(path) == path
    for path in ("a/" + 256 * "b", 2000 * "a/" + "b", "é" * 128, "a\0"):
        with pytest.raises(ValueError, match=r"than a system allows|a zero byte"):
            possible_path(path)


def sections(kind=Section):
    return [kind, *(inner for child in kind.__subclasses__() for inner in sections(child))]


@pytest.mark.parametrize("section", sections(), ids=lambda section: section.__name__)
def test_every_default_is_a_value_that_its_key_may_have(section):
    body = {"__module__": section.__module__, "model_config": {"validate_default": True}}
    strict = type(section.__name__, (section,), body)
    with pytest.raises(ValidationError) as found:
        strict(**{"": "no key"})
    types = {error["type"] for error in found.value.errors() if error["loc"][0]}
    assert types <= {"missing"}


LOG = {"files": ["a"], "columns": {"x": {"column": "x"}, "y": {"column": "y"}}}


@pytest.mark.parametrize(
    ("section", "settings", "near"),
    [
        (Logs, {**LOG, "files": ["a", {"path": "b", "sheet": "S"}]}, "files"),
        (Logs, {**LOG, "reader": "tdms", "columns": {**LOG["columns"], "z": {"column": 0}}}, None),
        (Logs, {**LOG, "columns": {**LOG["columns"], "z": {"column": "z", "rest": 1.0}}}, None),
        (Competitor, {"sum": [{"formula": "sarosi"}]}, "sum"),
        (Competitor, {"set": {"fit.max_terms": 1}, "as": "b", "levels": "nominal"}, None),
        (Competitor, {"model": "a.h5", "as": "b", "levels": "nominal"}, None),
        (Competitor, {"sum": [{"model": "a.yaml"}], "as": "b"}, "sum"),
        (campaigns.Campaign, {"campaign": "c", "runs": [{"base": "b.yaml"}, {"name": "n"}]}, None),
    ],
)
def test_a_single_wrong_part_among_others_is_refused(section, settings, near):
    with pytest.raises(ValidationError) as found:
        section.model_validate(settings)
    (error,) = found.value.errors()
    assert near is None or near in error["ctx"]["error"].near


@pytest.mark.parametrize("level", [False, True])
@pytest.mark.parametrize("group", [False, True])
def test_either_of_two_settings_is_enough(level, group):
    split = Split.model_construct(leave_one_level_out=level, leave_one_group_out=group)
    assert split.leaves_out is (level or group)
    assert Groups(of="g", offset=level, gain=group).has_effects is (level or group)


def test_a_single_quantity_may_divide_a_file_into_recordings():
    assert (Apart(of="a").quantities, Apart(of=["a", "b"]).quantities) == (["a"], ["a", "b"])


def test_levels_do_not_overlap():
    assert Levels(of="p", at=[1.0, 3.0], within=1.0).within == 1
    with pytest.raises(ValidationError, match="levels overlap: they are 2 apart"):
        Levels(of="p", at=[1.0, 3.0], within=1.1)


def test_a_level_that_is_given_twice_is_named():
    with pytest.raises(ValidationError, match="level 9, 16 is given twice"):
        Levels(of="p", at=[16.0, 9.0, 16.0, 9.0])


def test_states_that_need_equal_time_steps_are_told_in_order():
    states = [f"slow({name}, 1)" for name in "ebdac"]
    text = "*".join([*states, "play(f, 0.1)", "x"])
    assert timed_terms([DictionaryEntry(terms=[text])]) == tuple(sorted(states))
    assert remembers([DictionaryEntry(terms=[text])])


def test_a_spline_is_of_a_state_and_is_multiplied_by_expressions():
    spline = Spline.model_validate({"of": "x", "knots": 2, "with": ["y"]})
    assert [*texts_in((), spline)] == [(("of",), "x", False), (("with", 0), "y", True)]


def test_unknown_quantities_of_an_expression_are_told_in_the_order_of_the_alphabet():
    found = [*expression_findings("exp(e)*b*d*a*c", (), ["x"])]
    assert ["".join(re.findall("`([a-e])`", finding.message)) for finding in found] == [*"abcde"]


def test_a_dictionary_that_cannot_be_read_is_taken_for_one_without_memory():
    context = SimpleNamespace(context=None)
    for entry, remembered in (({"slow": {"of": ["x"], "tau": [1.0]}}, True), ({"slow": 1}, False)):
        assert _given_memory([entry], context) is remembered


def test_the_quantity_of_the_first_log_is_one_of_its_columns():
    join = {"shift": "auto", "match": {"first": "zzzzz", "second": "y"}, "files": ["b"]}
    join["columns"] = {name: {"column": name} for name in ("time", "y")}
    columns = {name: {"column": name} for name in ("time", "f1", "p2", "d3", "b4", "a5")}
    spec = ExperimentSpec.model_construct(data=Data(files=["a"], columns=columns, join=[join]))
    (finding,) = clocks(spec)
    assert finding.remedy.endswith("`a5`, `b4`, `d3`, `f1`, `p2`")


def test_paths_in_settings_of_a_competitor_are_moved_with_the_spec(tmp_path):
    settings = {"data.files": ["a.csv", {"path": "b.csv"}], "fit.max_terms": 2}
    rival = Competitor.model_validate({"set": settings, "as": "b"})
    moved = rival.model_dump(context=(tmp_path / "specs", tmp_path))["set"]
    assert moved["data.files"] == ["specs/a.csv", {"path": "specs/b.csv"}]


def test_runs_of_a_campaign_have_names_and_settings_in_order(tmp_path):
    (tmp_path / "c.yaml").write_text(
        "campaign: c\nbase: b.yaml\nruns: [{name: one, set: {fit.max_terms: 1}}, "
        "{base: d/x.yaml}, {base: e/x.yaml}]\n"
    )
    alone = tmp_path / "alone.yaml"
    alone.write_text("name: alone\n")
    unreadable = tmp_path / "binary.yaml"
    unreadable.write_bytes(b"\xff")  # the run that loads it says so
    found, entries = campaigns.expanded([alone, tmp_path / "c.yaml", unreadable], ["a=2"])
    assert [entry.called for entry in entries] == [
        *("alone", "one", "d/x.yaml", "e/x.yaml", "binary"),
    ]
    assert [entry.overrides for entry in entries[:3]] == [
        *(("a=2",), ('name="one"', "fit.max_terms=1", "a=2"), ("a=2",)),
    ]
    assert [entry.config.name for entry in entries[1:3]] == ["b.yaml", "x.yaml"]
    assert [each.jobs for each in found] == [(1, 2, 3)]
