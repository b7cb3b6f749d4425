"""`validate: {as: force}`: a model of the strain is inverted, and scored as force beside the direct
one.
"""

import json

import numpy as np
import pytest
from cli_samples import OWN, SPEC, by_place, options, page_of, write_lines, write_recording

TURNED = (
    "target={column: strain}",
    "segment={force: {method: even, count: 2, min_samples: 6}}",
    "dictionary=[{polynomial: {of: [force], order: 2}}]",
    "fit={max_terms: 2}",
)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The force is set, alike at three pressures, and the strain measured."""
    folder, rng = tmp_path_factory.mktemp("turned"), np.random.default_rng(5)
    for level in (100, 200, 300):
        force = np.linspace(0.0, 150.0, 40)
        strain = (0.05 + 0.0004 * level) * (1 - force / 400) + rng.normal(0, 2e-4, 40)
        write_recording(folder, "bench", level, strain, force)
    spec = folder / "bench.yaml"
    spec.write_text(
        SPEC.format(
            name="bench", levels=[100, 200, 300], split="  split: {validate: {pressure: [200]}}\n"
        )
    )
    return spec


def test_all_rows_are_of_the_force(study, tmp_path, mapmore, document):
    """The inverted model has the error that inverting it by hand, in `predict`, gives; the formulas
    have that of the direct study.
    """
    against = "validate.against=[polynomial_2]"
    turned = options(*TURNED, "validate.as=force", against, "name=turned")
    said = mapmore("run", study, *turned, code=0).stdout
    run = tmp_path / "runs" / "turned"
    assert json.loads((run / "scores.json").read_text())["units"] == {"force": "N"}
    rows = by_place(run / "scores.json")
    direct = by_place(document("validate", study, "-q", *options(against)))
    assert {row["target"] for row in rows.values()} == {"force"}
    formula = ("polynomial_2", *OWN[1:])
    assert rows[formula] == {**direct[formula], "target": "force"}
    _, *measured = (study.parent / "bench_200.csv").read_text().splitlines()
    write_lines(tmp_path / "table.csv", "pressure,strain,force", *measured)
    out = tmp_path / "out.csv"
    mapmore("predict", run / "model.h5", "table.csv", "-o", out, "--as", "force", code=0)
    found = np.genfromtxt(out, delimiter=",", names=True, dtype=None, encoding="utf-8")
    error = np.sqrt(np.mean((found["force_predicted"] - found["force"]) ** 2))
    assert rows[OWN]["rmse"] == pytest.approx(error, rel=1e-6)
    assert rows[OWN]["nrmse"] < 0.05
    verdict = f"mapmore predicts force with an NRMSE of {100 * rows[OWN]['nrmse']:.3g} % (RMSE "
    assert f"{verdict}{rows[OWN]['rmse']:.3g} N)" in said
    assert verdict in page_of("turned")
    assert "The model predicts strain; it is inverted, and scored as force." in page_of("turned")
