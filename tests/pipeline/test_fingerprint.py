"""Fingerprints and differences of slices."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from fake_study import study

from mapmore_cli.pipeline.differences import fingerprint, place_in_spec, recorded, slice_differences
from mapmore_cli.pipeline.staleness import _file_differences, _reasons, pipeline
from mapmore_cli.storage.run_record import StageRecord, Stamp
from mapmore_cli.study.experiment import ExperimentSpec


def test_order_of_keys_is_of_no_account():
    part = {"fit": {"a": 1, "b": [2, {"c": None}]}, "fuse": True}
    turned = {"fuse": True, "fit": {"b": [2, {"c": None}], "a": 1}}
    assert fingerprint("fit", 1, part, "", {}) == fingerprint("fit", 1, turned, "", {})
    assert slice_differences("fit", part, turned) == []


@pytest.mark.parametrize(
    ("key", "stage", "place"),
    [
        ("fuse", "fuse", "fuse"),
        ("levels", "segment", "data.levels"),
        ("against", "validate", "validate.against"),
        ("validate", "report", "validate"),
        ("unheard_of", "fit", "fit.unheard_of"),
    ],
)
def test_places_are_those_of_the_file(key, stage, place):
    assert place_in_spec(key, stage) == place


@pytest.mark.parametrize(
    ("old", "new", "differences"),
    [
        ({"fit": "x" * 60}, {"fit": "y"}, [f"fit: {'x' * 60} -> y"]),
        ({"fit": "x" * 61}, {"fit": "y"}, [f"fit: {'x' * 59}… -> y"]),
        ({"fit": ["ä" * 56]}, {"fit": ["ä" * 57]}, [f'fit: ["{"ä" * 56}"] -> ["{"ä" * 57}…']),
        ({"fit": [*range(100)]}, {"fit": [*range(99), 7]}, ["fit changed"]),
        ({"fit": {"a": 1, "b": 2}}, {"fit": {"b": 3, "c": None}},
         ["fit.b: 2 -> 3", "fit.c: not set -> null", "fit.a: 1 -> not set"]),
        ({"fit": [{"a": 1}, 2]}, {"fit": [{"a": 2}, 2]}, ["fit[0].a: 1 -> 2"]),
        ({"fit": [{"a": 1}]}, {"fit": [{"a": 1}, 2]}, ['fit: [{"a": 1}] -> [{"a": 1}, 2]']),
        ({"fit": [1, 2]}, {"fit": [1, 3]}, ["fit: [1, 2] -> [1, 3]"]),
        ([1], {"fit": 2}, ['fuse: [1] -> {"fit": 2}']),
    ],
)  # fmt: skip
def test_differences_have_their_place_and_both_values(old, new, differences):
    assert slice_differences("fuse", old, new) == differences


def stamps(**hashes):
    return {name: Stamp(1, 1, each) for name, each in hashes.items()}


def test_reasons_why_a_stage_runs():
    stage = SimpleNamespace(name="fuse", outputs=("model.h5", "report"))
    known = StageRecord(
        "f", 1, "b", {"fit": 1}, stamps(a="1", b="2"), stamps(**{"model.h5": "m", "report/x": "r"}),
        {}, 0.0, "",
    )  # fmt: skip
    assert _reasons(stage, None, known, "") == ["first time"]
    assert _reasons(stage, known, known, "ingest") == []
    changes = {
        "revision": (2, "stage revision 1 -> 2"),
        "slice": ({"fit": 2}, "fit: 1 -> 2"),
        "inputs": (stamps(a="1", b="3"), "source changed: b"),
        "before": ("c", "follows from ingest"),
        "fingerprint": ("g", "run.json is inconsistent"),
        "outputs": (stamps(**{"model.h5": "m"}), "output missing: report/x"),
    }
    for key, (changed, words) in changes.items():
        (reason,) = _reasons(stage, known, replace(known, **{key: changed}), "ingest")
        assert reason.startswith(words)
    assert _reasons(stage, known, replace(known, before="c"), "") == []
    now = replace(known, fingerprint="g", **{key: changes[key][0] for key in ("revision", "slice")})
    assert _reasons(stage, known, now, "ingest") == ["stage revision 1 -> 2", "fit: 1 -> 2"]
    more = SimpleNamespace(name="fuse", outputs=("model.h5", "report", "table.csv"))
    assert _reasons(more, known, known, "ingest") == ["output missing: table.csv"]
    empty = replace(known, outputs={})  # for example a report without formats
    assert _reasons(stage, empty, empty, "ingest") == []
    files = _file_differences("source", "removed", stamps(a="1", b="2"), stamps(b="3", c="4"))
    assert files == ["source removed: a", "source changed: b", "source added: c"]


SECTIONS = {
    "name": "other",
    "muscle": {"name": "B"},
    "units": {"load": "kN"},
    "needs": {"damping": "other.yaml"},
    "data": {"files": ["*.csv"], "columns": {"force": {"column": 0}, "strain": {"column": 1}}},
    "target": {"column": "strain"},
    "segment": {"strain": {"method": "even", "count": 2}},
    "dictionary": [{"terms": ["strain^2"]}],
    "formulas": [{"name": "unused", "expression": "a*strain", "parameters": {"a": {}}}],
    "model": {"type": "literature", "name": "sarosi"},
    "fit": {"max_terms": 2},
    "fuse": {"z_s": 0.3},
    "validate": {"simple": False},
    "report": {"formats": ["csv"]},
}


def test_every_section_is_read_by_a_stage():
    """The page shows all of them, also a section without effect on the results."""
    fields = ExperimentSpec.model_fields.items()
    assert {*SECTIONS} == {field.alias or name for name, field in fields} - {"schema_version"}

    def slices(**sections):
        return [recorded(stage.reads(study(Path(), **sections).spec)) for stage in pipeline()]

    for name, section in SECTIONS.items():
        assert slices(**{name: section}) != slices(), name
