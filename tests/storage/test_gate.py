"""The gate of names: each text that a result file holds is checked when it is read, or is a free
text that is only shown escaped.
"""

from dataclasses import is_dataclass, replace
from typing import Literal

import pytest
from test_artefacts import examples

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Dataset, Quantity
from mapmore_cli.domain.results import FitResult, Validation
from mapmore_cli.storage import artefacts
from mapmore_cli.storage.artefacts.schema import (
    SegmentationFile,
    bodies,
    stored_fields,
    taken_apart,
)

FREE = {
    *(
        "Dataset.notes",
        "FitResult.notes",
        "Model.notes",
        "MotionFit.notes",
        "FormulaFit.notes",
        "Validation.warnings",
        "FormulaFit.errors_note",
        "MemoryModel.errors_note",
        "SegmentFunction.errors_note",
    ),
    # a path, and the conditions that left samples out
    *("Recording.source", "Outlier.file", "Recording.dropped"),
    "FormulaFit.definition",  # a formula's source, which the parser reads
}


def texts(type_, seen):
    """Every text in the fields of a stored type and of those in it, with its hint."""
    if type_ in seen:
        return
    seen.add(type_)
    for name, (hint, _) in stored_fields(type_).items():
        waiting = [hint]
        while waiting:
            own = taken_apart(waiting.pop())
            if own.kind in (str, Literal):
                yield f"{type_.__name__}.{name}", own
            if is_dataclass(own.kind):
                yield from texts(own.kind, seen)
            for body in bodies(own.kind).values():
                yield from texts(body, seen)
            waiting += own.inner if own.kind is not Literal else ()


def test_every_text_passes_a_gate_or_is_free():
    seen = set()
    found = [
        text
        for root in (Dataset, SegmentationFile, FitResult, Model, Validation)
        for text in texts(root, seen)
    ]
    assert len(found) > 60
    assert {name for name, own in found if own.kind is str and not own.checks} == FREE


NAMES = [
    "Übung 7 µ = 3; (a), b",
    "O'Brien's",
    "pressure=150/strain:2",
    "試料",
    "a & b % # {c} ^ ~",
    "m2/x",
    "e\u0301",
]


@pytest.mark.parametrize("name", NAMES)
def test_names_of_files_may_have_letters_of_any_script(name, tmp_path):
    dataset = examples()["dataset"]
    dataset = replace(dataset, curves=(replace(dataset.curves[0], id=name, recordings=(name,)),))
    artefacts.write_dataset(tmp_path / "x.h5", dataset)
    assert artefacts.read_dataset(tmp_path / "x.h5").curves[0].id == name


HOSTILE = ["\"+__import__('os')+\"", "$(touch x)", "`x`", "\\input{x}", "</script>", "x" * 1001]


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        *(
            ({"output": Quantity(name, "N")}, "output/name, is not a valid name of a quantity")
            for name in [*HOSTILE, *NAMES, "", "2x", "a-b", "*/", "f'"]
        ),
        *(({"name": name}, "name, is not a valid name:") for name in HOSTILE),
    ],
)
def test_names_have_no_marks_that_a_language_takes_for_its_own(changed, told, tmp_path):
    """And those of quantities are identifiers: the output's ran as code where it was exported."""
    artefacts.write_model(tmp_path / "m.h5", replace(examples()["model"], **changed))
    with pytest.raises(DataError, match=told):
        artefacts.read_model(tmp_path / "m.h5")
