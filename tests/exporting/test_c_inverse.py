"""Derivatives and inverses in C have the numbers of those in Python."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from agreement import FLAGS, compiled, points, sanitized
from export_samples import FORMULAS, STATIC, WITH_MEMORY, pieces
from inverse_agreement import inversion

from mapmore_cli.exporting.c_source import c_source
from mapmore_cli.modelling.inverse import LOWEST, NEAREST, invert
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.program.model import slopes

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no C compiler here")


@pytest.mark.parametrize("name", ["smooth levels, aligned", "backbone, shrunken", "a difference"])
def test_derivatives_at_every_boundary(tmp_path: Path, name: str) -> None:
    model = STATIC[name]
    columns = points(model, 1000)
    found, expected = compiled(model, tmp_path, more=("-O0",), inverse=()).slopes(columns), slopes(model, columns)
    for quantity in model.inputs:
        own, other = found[quantity.name], expected[quantity.name]
        assert np.array_equal(np.isnan(own), np.isnan(other))
        assert np.nanmax(np.abs(own - other) / np.maximum(np.abs(other), np.nanmedian(np.abs(other)))) < 1e-12


@pytest.mark.parametrize(
    ("name", "of"), [("steps", "pressure"), ("widest zones, zero", "pressure"), ("one level", "strain"), ("sarosi", "strain")]
)
def test_the_inverse_picks_what_python_picks(tmp_path: Path, name: str, of: str) -> None:
    """Solutions that are there, targets out of reach, flat ranges, and numbers that are none; by both rules."""
    model, rng = {**STATIC, **FORMULAS}[name], np.random.default_rng(3)
    at = {"pressure": rng.uniform(100.0, 500.0, 12), "strain": rng.uniform(0.03, 0.2, 12)}
    wanted = predict(model, at)
    wanted[:3] = [1e9, 0.0, np.nan]
    given = {one: x for one, x in at.items() if one != of}
    given["strain" if of == "pressure" else "pressure"][3] = np.nan
    built = compiled(model, tmp_path, inverse=(of,))
    for rule in (LOWEST, NEAREST):
        with np.errstate(all="ignore"):
            expected = invert(model, wanted, given, of, rule)
        found, status = built.invert(wanted, given, of, rule)
        assert status == expected.status
        assert len(set(status)) > 1
        assert np.array_equal(np.isnan(found), np.isnan(expected.picked))
        assert np.nanmax(np.abs(found - expected.picked)) <= 1e-12 * np.nanmax(np.abs(expected.picked))


@pytest.mark.parametrize(("name", "of"), [("steps", "strain"), ("values", "strain"), ("quadratic, continued straight", "pressure")])
def test_every_root_of_a_scan_is_found_where_the_map_turns_and_jumps(name: str, of: str) -> None:
    found = inversion(name, STATIC[name], of, 250)
    assert found.missed == 0
    assert found.roots > 300
    assert found.error < 1e-6


def test_single_precision_comes_as_near_as_it_can(tmp_path: Path) -> None:
    model = replace(FORMULAS["sarosi"], name="single")
    pressure, strain = np.linspace(150.0, 450.0, 9), np.full(9, 0.1)
    wanted = predict(model, {"pressure": pressure, "strain": strain})
    found, status = compiled(model, tmp_path, single=True, inverse=("pressure",)).invert(wanted, {"strain": strain}, "pressure", LOWEST)
    assert set(status) == {"one"}
    assert np.max(np.abs(found - pressure)) < 0.01
    assert "double" not in (tmp_path / "single_inverse.c").read_text()


def test_models_with_memory_have_neither() -> None:
    assert not [name for name in c_source(WITH_MEMORY["lags"]).files if "inverse" in name]


def test_what_a_sum_renames_has_derivatives_and_no_inverse(tmp_path: Path) -> None:
    """Its range is not known in the sum's own inputs."""
    model = STATIC["a difference"]
    inner = replace(model, body=replace(model.body, parts=model.body.parts[1:]))  # type: ignore[type-var]
    source = c_source(inner)
    assert "_invert_" not in source.files[f"{source.name}_inverse.h"]
    for name, text in source.files.items():
        (tmp_path / name).write_text(text)
    subprocess.run(["gcc", *FLAGS, "-O0", "-c", f"{source.name}_inverse.c"], cwd=tmp_path, check=True)


def test_no_heap_no_globals_in_the_second_file() -> None:
    text = c_source(pieces()).files["dmsp_20_inverse.c"]
    assert "malloc" not in text
    assert [line for line in text.splitlines() if line.startswith("#include")] == ['#include "dmsp_20_inverse.h"', "#include <math.h>"]


def test_derivatives_are_clean_under_the_sanitizers(tmp_path: Path) -> None:
    model = STATIC["one level"]
    columns = points(model, 500)
    assert np.allclose(sanitized(model, tmp_path, columns), predict(model, columns), rtol=1e-12, atol=0)
