"""What is made from the declarations: the JSON Schema and the reference of keys; and open questions
of a spec.
"""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_type_hints

import jsonschema
import pytest
from pydantic import BaseModel
from spec_examples import GOOD, PROJECT, SHIPPED, STATIC

from mapmore_cli.domain.scores import METRICS, Score
from mapmore_cli.spec.experiment import ExperimentSpec
from mapmore_cli.spec.loader import confirmed, questions_in
from mapmore_cli.spec.schema import json_schema, reference
from mapmore_cli.spec.sections.dictionary import Families, OperatorFamily
from mapmore_cli.spec.tree import Kind, SourceText, fields_of, kinds, plain
from mapmore_cli.spec.yaml_loader import parse

VALIDATOR = jsonschema.Draft202012Validator(json_schema())


def document(text: str) -> Any:
    return plain(parse(SourceText("t.yaml", Path(), text), []))


def test_the_checked_in_schema_is_up_to_date() -> None:
    text = (PROJECT / "configs" / "experiment.schema.json").read_text(encoding="utf-8")
    assert text == json.dumps(json_schema(), indent=2) + "\n", "run `make schema`"


def test_it_is_a_schema_with_descriptions() -> None:
    schema = json_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert [
        name for name, section in schema["$defs"].items() if not section.get("description")
    ] == []


@pytest.mark.parametrize(
    "study", [*GOOD.values(), *SHIPPED], ids=[*GOOD, *(path.stem for path in SHIPPED)]
)
def test_good_documents_validate(study: str | Path) -> None:
    text = study.read_text(encoding="utf-8") if isinstance(study, Path) else study
    assert [error.message for error in VALIDATOR.iter_errors(document(text))] == []


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("max_terms: 1", "max_term: 1"),
        ("max_terms: 1,", "max_terms: 0,"),
        ("length: 88 mm", "length: long"),
        ("target: static", "target: statics"),
        ("target: static\n", ""),
        ('  files: ["../datasets/mckibben/load_cycle_*.csv"]\n', ""),
        ("{pressure: [250]}", "{pressure: 250}"),
        ("extrapolation: continue", "extrapolation: {strain: {above: zerro}}"),
        ("method: even", "method: odd"),
    ],
)
def test_an_editor_sees_the_slips(old: str, new: str) -> None:
    assert old in STATIC
    assert list(VALIDATOR.iter_errors(document(STATIC.replace(old, new))))


def test_an_heir_may_leave_out_what_it_inherits() -> None:
    assert not list(
        VALIDATOR.iter_errors(
            document("extends: base.yaml\nname: heir\ndata: {levels: {at: [1, 2 bar]}}\n")
        )
    )
    assert list(VALIDATOR.iter_errors(document("name: orphan\ndata: {levels: {at: [1, 2 bar]}}\n")))


def test_every_key_is_in_the_reference_and_every_link_has_its_heading() -> None:
    text = reference()
    for section in json_schema()["$defs"].values():
        for key in section.get("properties", {}):
            assert f"| `{key}` |" in text
    headings = {
        heading.lower().replace(" ", "-")
        for heading in re.findall(r"^### (.*)$", text, re.MULTILINE)
    }
    assert set(re.findall(r"\]\(#([^)]+)\)", text)) <= headings


def test_every_number_of_a_score_is_a_metric() -> None:
    assert list(METRICS) == [
        name for name, kind in get_type_hints(Score).items() if kind in (int, float)
    ]


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


def test_questions_are_found_with_their_keys_and_go_when_they_are_confirmed() -> None:
    assert questions_in(SPEC) == (
        "time: it never decreases",
        "force: a force, or a position? Values do not tell",
        "target: tried",
    )
    assert questions_in(confirmed(SPEC)) == ()
    assert "# it never decreases" in confirmed(SPEC)


# Every key does something: what a user writes is read outside of `spec/`
# ------------------------------------------------------------

PACKAGE = PROJECT / "mapmore_cli"
NOTES = {("Muscle", "name"), ("Muscle", "kind"), ("ExperimentSpec", "schema_version")}
"""What is there to be kept, not to be computed with."""


def sections() -> list[type]:
    found: list[type] = []
    left: list[type] = [ExperimentSpec]
    while left:
        model = left.pop()
        if model in found:
            continue
        found.append(model)
        left += [
            section
            for hint in fields_of(model)[0].values()
            for kind in kinds(hint)
            for section in _inside(kind)
        ]
    return [
        model for model in found if not issubclass(model, (Families, OperatorFamily))
    ]  # are handed on whole, by name


def _inside(kind: Kind) -> Iterator[type]:
    if kind.is_section:
        yield kind.type
    for argument in getattr(kind.type, "__args__", ()):
        for inner in kinds(argument):
            yield from _inside(inner)


def attributes_read(files: list[Path]) -> set[str]:
    trees = [ast.parse(file.read_text(encoding="utf-8")) for file in files]
    nodes = [node for tree in trees for node in ast.walk(tree)]
    return {
        node.attr
        for node in nodes
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load)
    }


def properties_of(model: type) -> dict[str, set[str]]:
    """The properties and methods of a section, with what each reads of the section itself."""
    model = model if model.__name__ != "ModelChoice" else model.__mro__[1]  # kinds add keys to it
    source = ast.parse(
        (PACKAGE.parent / Path(*model.__module__.split(".")))
        .with_suffix(".py")
        .read_text(encoding="utf-8")
    )
    body = next(
        node
        for node in source.body
        if isinstance(node, ast.ClassDef) and node.name == model.__name__
    ).body
    return {
        node.name: {read.attr for read in ast.walk(node) if isinstance(read, ast.Attribute)}
        for node in body
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_")
    }


@pytest.fixture(scope="module")
def outside() -> set[str]:
    """What is read outside of `spec/`, and of the files that declare the sections."""
    declaring = {
        PACKAGE.parent / Path(*model.__module__.split(".")).with_suffix(".py")
        for model in sections()
    }
    return attributes_read(
        [
            file
            for file in PACKAGE.rglob("*.py")
            if PACKAGE / "spec" not in file.parents and file not in declaring
        ]
    )


def test_every_field_is_read_outside_of_the_spec(outside: set[str]) -> None:
    for model in sections():
        through = set().union(
            *(reads for name, reads in properties_of(model).items() if name in outside)
        )
        own = model.model_fields if issubclass(model, BaseModel) else vars(model)["__annotations__"]
        unread = [
            name
            for name in own
            if (model.__name__, name) not in NOTES and name not in outside | through
        ]
        assert unread == [], model.__name__


def test_a_field_that_nobody_reads_is_found(outside: set[str]) -> None:
    assert "a_key_that_does_nothing" not in outside
    assert {"Data", "Join", "Cuts", "Competitor", "Products"} <= {
        model.__name__ for model in sections()
    }
