"""Exported C agrees with `predict` for models of every kind, at every boundary; its derivatives and
inverses with those in Python.
"""

import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from agreement import FLAGS, compare, compiled, difference, points, recording, sanitized
from export_samples import FORMULAS, STATIC, WITH_MEMORY, formula, memory, pieces
from inverse_agreement import inversion

from mapmore_cli.annexes.exporting.c_source import c_source
from mapmore_cli.domain.errors import DataError, UsageError
from mapmore_cli.modelling.inverse import LOWEST, NEAREST, invert
from mapmore_cli.modelling.kinds import predict, runs_over_time
from mapmore_cli.modelling.programs import slopes

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no C compiler here")


@pytest.mark.parametrize("name", STATIC)
def test_pieces_and_sums(tmp_path, name):
    assert compare(STATIC[name], tmp_path, 30_000)[0] < 1e-12


@pytest.mark.parametrize(
    "name",
    [
        "sarosi_hinged",
        "tondu_lopez_corrected",
        "kerscher",
        "peternel",
        "polynomial_5",
        "tondu_kinetic_friction",
        "reynolds",
    ],
)
def test_formulas(tmp_path, name):
    assert compare(FORMULAS[name], tmp_path)[0] < 1e-12


@pytest.mark.parametrize("name", WITH_MEMORY)
def test_whole_recordings_in_free_run(tmp_path, name):
    assert compare(WITH_MEMORY[name], tmp_path, 3_000)[0] < 1e-12


def test_a_run_that_diverges_has_no_value_up_to_a_reset(tmp_path):
    model = WITH_MEMORY["diverging"]
    columns = recording(model, 500)
    found, bits = compiled(model, tmp_path).run(columns)
    assert np.isnan(predict(model, columns)[-1]), "the sample has to diverge"
    assert np.isnan(found[-1])
    assert np.isfinite(found[10])
    assert bits[-1] & 2


def test_an_input_that_is_not_finite_sets_its_bit_and_lets_memory_start_anew(
    tmp_path,
):
    model = WITH_MEMORY["operators"]
    columns = recording(model, 400)
    columns["strain"][100] = np.nan
    found, bits = compiled(model, tmp_path).run(columns)
    assert bits[100] & 2
    assert not bits[100] & 1
    assert difference(found, predict(model, columns)) < 1e-12


def test_every_formula_compiles(tmp_path):
    files = []
    for model in FORMULAS.values():
        for name, text in c_source(model).files.items():
            (tmp_path / name).write_text(text)
        files.append(f"{c_source(model).name}.c")
    assert len(files) > 15
    subprocess.run(["gcc", *FLAGS, "-c", *files], cwd=tmp_path, check=True)


def test_single_precision(tmp_path):
    model = replace(STATIC["straight beyond the levels"], name="short_numbers")
    single = compiled(model, tmp_path, single=True)
    columns = {
        name: x.astype(np.float32).astype(np.float64) for name, x in points(model, 2000).items()
    }
    inside = {
        "pressure": np.clip(columns["pressure"], 110, 490),
        "strain": np.clip(columns["strain"], 0.03, 0.19),
    }
    found, _ = single.run(inside)
    assert np.max(np.abs(found - predict(model, inside))) < 1e-4 * np.max(
        np.abs(predict(model, inside))
    )
    assert " double " not in (tmp_path / "short_numbers.c").read_text()


@pytest.mark.parametrize(
    "model",
    [STATIC["straight on one side"], WITH_MEMORY["operators"], WITH_MEMORY["fed back"]],
    ids=["static", "memory", "fed back"],
)
def test_code_and_derivatives_run_clean_under_the_sanitizers(tmp_path, model):
    columns = recording(model, 500) if runs_over_time(model) else points(model, 500)
    with np.errstate(all="ignore"):
        expected = predict(model, columns)
    assert difference(sanitized(model, tmp_path, columns), expected) < 1e-12


@pytest.mark.parametrize(
    ("name", "identifier"),
    [
        ("dmsp-20-88", "dmsp_20_88"),
        ("20 mm", "model_20_mm"),
        ("double", "model_double"),
        ("a  b!", "a_b"),
        ("x", "model_x"),  # an input `reset` of a model `x` is `x_reset`
    ],
)
def test_names_that_c_does_not_allow(name, identifier):
    source = c_source(replace(pieces(), name=name))
    assert source.name == identifier
    assert f"int {identifier}_eval(" in source.files[f"{identifier}.h"]


def test_a_name_without_a_letter_is_refused():
    with pytest.raises(UsageError, match="no letter"):
        c_source(replace(pieces(), name="¿?"))


def test_the_header_has_names_and_units_in_the_order_of_the_inputs():
    header = c_source(pieces()).files["dmsp_20.h"]
    assert "#define DMSP_20_INPUTS 2" in header
    assert "#define DMSP_20_IN_PRESSURE 0 /* pressure [kPa] */" in header
    assert "#define DMSP_20_IN_STRAIN 1 /* strain [1] */" in header


def test_a_formula_that_is_no_expression_is_refused():
    with pytest.raises(DataError, match="not a closed expression"):
        c_source(formula("sarosi_hysteresis_loss"))


def test_no_heap_no_globals():
    for model in (pieces(), memory(("pressure[k-1]",), ("pressure[k-1]",))):
        for file, text in c_source(model).files.items():
            if not file.endswith(".c") or "_main" in file:
                continue
            assert "malloc" not in text
            assert [line for line in text.splitlines() if line.startswith("#include")][1:] == [
                "#include <math.h>"
            ]
            # whose knots are constants, and its types are named
            lines = [] if "_inverse" in file else text.splitlines()
            outside = [
                line for line in lines if line and not line[0].isspace() and line[0] not in "{}/#"
            ]
            assert all("(" in line for line in outside), "only functions stand outside of functions"


@pytest.mark.parametrize("name", ["straight on one side", "backbone, shrunken", "a difference"])
def test_derivatives_at_every_boundary(tmp_path, name):
    model = STATIC[name]
    columns = points(model, 1000)
    found, expected = (
        compiled(model, tmp_path, more=("-O0",), inverse=()).slopes(columns),
        slopes(model, columns),
    )
    for quantity in model.inputs:
        own, other = found[quantity.name], expected[quantity.name]
        assert np.array_equal(np.isnan(own), np.isnan(other))
        assert (
            np.nanmax(np.abs(own - other) / np.maximum(np.abs(other), np.nanmedian(np.abs(other))))
            < 1e-12
        )


@pytest.mark.parametrize(
    ("name", "of"),
    [
        ("steps", "pressure"),
        ("widest zones, zero", "pressure"),
        ("one level", "strain"),
        ("sarosi", "strain"),
    ],
)
def test_the_inverse_picks_what_python_picks(tmp_path, name, of):
    """Solutions that are there, targets out of reach, flat ranges, and numbers that are none; by
    both rules.
    """
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
        assert np.nanmax(np.abs(found - expected.picked)) <= 1e-12 * np.nanmax(
            np.abs(expected.picked)
        )


@pytest.mark.parametrize(
    ("name", "of"),
    [("steps", "strain"), ("values", "strain"), ("quadratic, continued straight", "pressure")],
)
def test_every_root_of_a_scan_is_found_where_the_map_turns_and_jumps(name, of):
    found = inversion(name, STATIC[name], of, 250)
    assert found.missed == 0
    assert found.roots > 300
    assert found.error < 1e-6


def test_models_with_memory_have_neither():
    assert not [name for name in c_source(WITH_MEMORY["lags"]).files if "inverse" in name]


def test_what_a_sum_renames_has_derivatives_and_no_inverse(tmp_path):
    """Its range is not known in the sum's own inputs."""
    model = STATIC["a difference"]
    inner = replace(model, body=replace(model.body, parts=model.body.parts[1:]))
    source = c_source(inner)
    assert "_invert_" not in source.files[f"{source.name}_inverse.h"]
    for name, text in source.files.items():
        (tmp_path / name).write_text(text)
    subprocess.run(
        ["gcc", *FLAGS, "-O0", "-c", f"{source.name}_inverse.c"], cwd=tmp_path, check=True
    )
