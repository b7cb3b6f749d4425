"""Every key of a spec does something: what a user writes is read outside of `spec/`."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest
from pydantic import BaseModel

from mapmore_cli.spec.experiment import ExperimentSpec
from mapmore_cli.spec.sections.dictionary import Families, OperatorFamily
from mapmore_cli.spec.tree import Kind, fields_of, kinds

PACKAGE = Path(__file__).parents[2] / "mapmore_cli"
NOTES = {("Muscle", "name"), ("Muscle", "kind"), ("ExperimentSpec", "schema_version")}
"""What is there to be kept, not to be computed with."""


def sections() -> list[type]:
    """Every section that a spec can hold."""
    found: list[type] = []
    left: list[type] = [ExperimentSpec]
    while left:
        model = left.pop()
        if model in found:
            continue
        found.append(model)
        left += [section for hint in fields_of(model)[0].values() for kind in kinds(hint) for section in _inside(kind)]
    return [model for model in found if not issubclass(model, (Families, OperatorFamily))]  # are handed on whole, by name


def _inside(kind: Kind) -> Iterator[type]:
    if kind.is_section:
        yield kind.type
    for argument in getattr(kind.type, "__args__", ()):
        for inner in kinds(argument):
            yield from _inside(inner)


def attributes_read(files: list[Path]) -> set[str]:
    """Names of attributes that are read."""
    trees = [ast.parse(file.read_text(encoding="utf-8")) for file in files]
    nodes = [node for tree in trees for node in ast.walk(tree)]
    return {node.attr for node in nodes if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load)}


def properties_of(model: type) -> dict[str, set[str]]:
    """The properties and methods of a section, with what each reads of the section itself."""
    source = ast.parse((PACKAGE.parent / Path(*model.__module__.split("."))).with_suffix(".py").read_text(encoding="utf-8"))
    body = next(node for node in source.body if isinstance(node, ast.ClassDef) and node.name == model.__name__).body
    return {
        node.name: {read.attr for read in ast.walk(node) if isinstance(read, ast.Attribute)}
        for node in body
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_")
    }


@pytest.fixture(scope="module")
def outside() -> set[str]:
    """What is read outside of `spec/`, and of the files that declare the sections."""
    declaring = {PACKAGE.parent / Path(*model.__module__.split(".")).with_suffix(".py") for model in sections()}
    return attributes_read([file for file in PACKAGE.rglob("*.py") if PACKAGE / "spec" not in file.parents and file not in declaring])


def test_every_field_is_read_outside_of_the_spec(outside: set[str]) -> None:
    for model in sections():
        through = set().union(*(reads for name, reads in properties_of(model).items() if name in outside))
        own = model.model_fields if issubclass(model, BaseModel) else vars(model)["__annotations__"]
        unread = [name for name in own if (model.__name__, name) not in NOTES and name not in outside | through]
        assert unread == [], model.__name__


def test_a_field_that_nobody_reads_is_found(outside: set[str]) -> None:
    assert "a_key_that_does_nothing" not in outside
    assert {"Data", "Join", "Cuts", "Competitor", "Products"} <= {model.__name__ for model in sections()}
