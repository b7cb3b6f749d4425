"""Make the reference of all fields in result files, for docs/file-format.md."""

from __future__ import annotations

import types
from collections.abc import Mapping
from dataclasses import MISSING, is_dataclass
from typing import Any, Literal, Union

import numpy as np

from mapmore_cli.domain.declared import prose
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.domain.results import FitResult, Validation
from mapmore_cli.storage.artefacts.schema import (
    NO_UNIT,
    SegmentationFile,
    bodies,
    stored_fields,
    taken_apart,
)

WORDS = {str: "text", Literal: "text", types.NoneType: "null", range: "[int, int]"}
"""Names of types in the reference."""


def described() -> str:
    """Return the reference as Markdown for docs/file-format.md. It has a section for each type of
    object that is stored. If an object contains objects of other types, their sections come first.
    """
    head = "| name | stored as | unit | what it is |\n|---|---|---|---|\n"
    sections: dict[str, str] = {}

    def form(hint: object) -> str:
        """Return the name of a type as it stands in the reference, and add the sections of all
        types inside it.
        """
        shape = taken_apart(hint)
        if shape.kind is np.ndarray:
            return f"`{shape.inner[0].__name__}[{',' * (len(shape.letters) - 1)}]`"
        if known := bodies(shape.kind):
            return ", ".join(f"`{word}`: {form(type_)}" for word, type_ in known.items())
        if is_dataclass(shape.kind):
            return section(shape.kind)
        if shape.kind in (Union, tuple, Mapping):
            head = {Union: "", tuple: "list of ", Mapping: "object of "}[shape.kind]
            return head + " or ".join(
                dict.fromkeys(
                    form(inner)
                    for inner in shape.inner[shape.kind is Mapping :]
                    if inner is not ...
                )
            )
        return f"`{WORDS.get(shape.kind, shape.kind.__name__)}`"

    def section(type_: Any) -> str:
        name = type_.__name__
        link = f"[{name}](#{name.lower()})"
        if name in sections:
            return link
        sections[name] = ""
        rows = ""
        for field, (hint, default) in stored_fields(type_).items():
            shape = taken_apart(hint)
            unit, optional = (
                f"`{shape.unit}`" if shape.unit else NO_UNIT,
                "" if default is MISSING else " ?",
            )
            rows += (
                f"| `{field}` | {form(hint)}{optional} | {unit} | {shape.description or field} |\n"
            )
        del sections[name]
        sections[name] = (
            f"### {name}\n\n{prose(type_.__doc__).partition(chr(10))[0]}\n\n{head}{rows}\n"
        )
        return link

    for root in (Dataset, SegmentationFile, FitResult, Model, Validation):
        section(root)
    return "".join(sections.values())
