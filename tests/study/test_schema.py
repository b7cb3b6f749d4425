"""What is made from the declarations: the JSON Schema and the reference of keys; and open questions
of a spec.
"""

import ast
import json
import re
from functools import cache
from pathlib import Path

import jsonschema
import pytest
from spec_examples import GOOD, PROJECT, SHIPPED, STATIC

from mapmore_cli.domain.scores import METRICS, OF_TARGET
from mapmore_cli.study.experiment import ExperimentSpec
from mapmore_cli.study.loader import confirmed, questions_in
from mapmore_cli.study.schema import _meaning, json_schema, reference
from mapmore_cli.study.sections.dictionary import FORMS
from mapmore_cli.study.tree import SourceText, written
from mapmore_cli.study.yaml_loader import parse

VALIDATOR = jsonschema.Draft202012Validator(json_schema())


def document(text):
    return written(parse(SourceText("t.yaml", Path(), text), []))


def test_the_checked_in_schema_is_up_to_date():
    text = (PROJECT / "configs" / "experiment.schema.json").read_text(encoding="utf-8")
    assert text == json.dumps(json_schema(), indent=2) + "\n", "run `make schema`"


def test_every_key_says_what_it_is_its_default_its_unit_and_an_example():
    schema, plain = json_schema(), ExperimentSpec.model_json_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    for name, section in {"Top level": schema, **schema["$defs"]}.items():
        assert section["description"], name
        needed = plain["$defs"].get(name, plain).get("required", ())
        for key, value in section.get("properties", {}).items():
            place = f"{name}.{key}"
            assert len(value["description"]) > 1, place
            assert "default" in value or key in needed or key == "extends", place
            kinds = set(re.findall(r"'type': '(\w+)'", str(value)))
            assert ("unit" in value) == bool(kinds & {"number", "integer"}), place
            example = {"$defs": schema["$defs"], **value}
            (shown,) = value["examples"]
            assert shown not in (None, [], {}), place
            assert jsonschema.Draft202012Validator(example).is_valid(shown), place


@pytest.mark.parametrize(
    "study", [*GOOD.values(), *SHIPPED], ids=[*GOOD, *(path.stem for path in SHIPPED)]
)
def test_good_documents_validate(study):
    text = study.read_text(encoding="utf-8") if isinstance(study, Path) else study
    assert [error.message for error in VALIDATOR.iter_errors(document(text))] == []


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("max_terms: 1", "max_term: 1"),
        ("max_terms: 1,", "max_terms: 0,"),
        ("length: 88 mm", "length: long"),
        ("target: static", "target: [7]"),
        ("target: static\n", ""),
        ('  files: ["../datasets/mckibben/load_cycle_*.csv"]\n', ""),
        ("{pressure: [250]}", "{pressure: 250}"),
        ("extrapolation: continue", "extrapolation: {strain: {above: zerro}}"),
        ("method: even", "method: odd"),
    ],
)
def test_an_editor_sees_the_slips(old, new):
    assert old in STATIC
    assert list(VALIDATOR.iter_errors(document(STATIC.replace(old, new))))


def test_an_heir_may_leave_out_what_it_inherits():
    assert not list(
        VALIDATOR.iter_errors(
            document("extends: base.yaml\nname: heir\ndata: {levels: {at: [1, 2 bar]}}\n")
        )
    )
    assert list(VALIDATOR.iter_errors(document("name: orphan\ndata: {levels: {at: [1, 2 bar]}}\n")))


def test_every_key_is_in_the_reference_and_every_link_has_its_heading():
    text = reference()
    for section in json_schema()["$defs"].values():
        for key in section.get("properties", {}):
            assert f"| `{key}` |" in text
    headings = {
        heading.lower().replace(" ", "-")
        for heading in re.findall(r"^### (.*)$", text, re.MULTILINE)
    }
    assert set(re.findall(r"\]\(#([^)]+)\)", text)) <= headings


def test_examples_are_written_as_in_a_spec():
    assert _meaning({"description": "length", "unit": "m", "examples": ["5 µm"]}) == (
        'Length. Unit: m. Example: `"5 µm"`.'
    )


def test_rows_of_the_reference_have_values_default_unit_and_example():
    text = reference()
    for key, cells, end in (
        ("z_s", "number ≥ 0 ≤ 0.5 | `0.25`", "range. Example: `0.25`. |"),
        ("within", "number > 0 or with unit | ", "Unit: that of `of`, as a difference. Example:"),
        ("at", 'list of number or with unit or `auto` | `"auto"`', "Unit: that of `of`. Example:"),
        ("fit", "[Fit](#fit) | ", "How terms are chosen, and how many. Example:"),
        ("labels", "mapping | ", "Axis labels by quantity."),
        ("name", "text | **required**", "Name of the run and of its folder."),
        ("size", "number ≥ 5 ≤ 24 | `8.0`", "smaller. Unit: pt. Example: `9`. |"),
        ("rmse", "root of the mean squared error", "the target |"),
        ("r2", "coefficient of determination", "1 |"),
    ):
        rows = [row for row in text.splitlines() if row.startswith(f"| `{key}` | {cells} | ")]
        assert any(end in row for row in rows), key
    assert "of `n`, `r2`, `r_uncentred` and `interval_coverage` is the smallest" in text


SPEC = """\
# look first at those marked CHECK
data:
  columns:
    time: {column: 0}  # CHECK: it never decreases
    # CHECK: a force, or a position?
    # Values do not tell
    force: {column: 1}  # nothing open
  files: ["a # CHECK b"]
target: static  # CHECK: tried
"""


def test_questions_are_found_with_their_keys_and_go_when_they_are_confirmed():
    assert questions_in(SPEC) == (
        "time: it never decreases",
        "force: a force, or a position? Values do not tell",
        "target: tried",
    )
    assert questions_in(confirmed(SPEC)) == ()
    assert "# it never decreases" in confirmed(SPEC)


# Every key does something: what a user writes is read, and not only to be refused
# --------------------------------------------------------------------------------------------------

PACKAGE = PROJECT / "mapmore_cli"
NOTES = {"kind", "schema_version"}
"""What is there to be kept, not to be computed with."""
ALIASES = {"validate": "validation", "with": "partners", "as": "as_"}
REFUSING = ("_contradictions", "__post_init__")


@cache
def trees():
    return [ast.parse(file.read_text(encoding="utf-8")) for file in PACKAGE.rglob("*.py")]


def attributes_read(tree):
    refusing = {
        inner
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and node.name in REFUSING
        for inner in ast.walk(node)
    }
    return {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and node not in refusing
    }


def test_every_key_is_read():
    schema = json_schema()
    handed_on = {"DictionaryEntry", *(form.__name__ for form in FORMS.values())}  # by name
    keys = {
        key
        for name, section in schema["$defs"].items()
        if name not in handed_on
        for key in section.get("properties", {})
    }
    assert {"max_gap", "min_samples", "sum", "order"} <= keys
    read = set().union(*map(attributes_read, trees()))
    unread = {key for key in {*keys, *schema["properties"]} if ALIASES.get(key, key) not in read}
    assert unread - NOTES - {"extends"} == set()


def words_in(tree):
    """Texts and names of functions in a file, without docstrings and declared choices."""
    words, declared = set(), set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Subscript) and getattr(node.value, "id", "") == "Literal":
            declared.update(ast.walk(node))
        elif isinstance(node, ast.Expr):
            declared.add(node.value)
        elif isinstance(node, ast.Constant | ast.FunctionDef) and node not in declared:
            words.add(getattr(node, "value", getattr(node, "name", "")))
    return words


def test_every_choice_of_a_key_is_looked_for():
    """A choice that is only declared would do what another one does."""
    choices = re.findall(r"'enum': \[('.*?)\]", str(json_schema()))
    words = {word for each in choices for word in ast.literal_eval(f"[{each}]")}
    assert {"pchip", "bisquare", "residual_map"} <= words
    assert words - set().union(*map(words_in, trees())) == set()


def test_every_score_says_in_words_what_it_means():
    assert not any(meaning.startswith("[") for meaning in METRICS.values())
    assert {"rmse"} <= OF_TARGET < {*METRICS}
