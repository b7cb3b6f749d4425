"""`mapmore figure`: one panel of a finished run."""

from pathlib import Path

import numpy as np
from cli_samples import csv_rows, write_lines


def test_one_curve_as_pdf_with_its_numbers(finished, mapmore):
    _, runs = finished
    arguments = ("fit", "--curve", "200", "-o", "fig3.pdf", "--data", "fig3.csv")
    assert mapmore("figure", runs / "bench", *arguments, code=0).stderr == ""
    first = Path("fig3.pdf").read_bytes()
    assert first.startswith(b"%PDF")
    rows = csv_rows(Path("fig3.csv").read_text())
    assert len(rows) == 40
    assert {"strain [1]", "force [N]", "data", "mapmore [N]", "polynomial_2 [N]"} <= {*rows[0]}
    mapmore("figure", "bench", *arguments, "--runs", runs, code=0)
    assert Path("fig3.pdf").read_bytes() == first


def test_the_models_that_are_named_are_drawn_and_no_others(finished, mapmore):
    files = ("-o", "a.svg", "--data", "a.csv")
    arguments = ("fit", "--curve", "200", *files, "--models", "cubic, plane")
    mapmore("figure", finished[1] / "bench", *arguments, code=0)
    head, *_ = Path("a.csv").read_text().splitlines()
    assert "mapmore [N]" in head
    assert "plane [N]" in head or "cubic [N]" in head
    assert "polynomial_2" not in head + Path("a.svg").read_text()


RECORD = """\
name: record
data: {files: [r.csv], columns: {time: {column: t, unit: s}, pressure: {column: P, unit: kPa},
    strain: {column: e}, force: {column: F, unit: N}}}
target: {column: force}
model: {type: literature, name: polynomial_2}
validate: {against: [chou_hannaford], simple: false}
report: {over: time, figures: [fit]}
"""


def test_a_formula_on_a_record_is_drawn_over_time_and_called_by_its_name(tmp_path, mapmore):
    t = np.arange(0.0, 3.0, 0.05)
    rows = zip(
        t, 200 + 50 * np.sin(3 * t), 0.1 + 0.1 * np.cos(t), 100 + 30 * np.sin(t), strict=True
    )
    (tmp_path / "record.yaml").write_text(RECORD)
    lines = [",".join(f"{one:.6g}" for one in row) for row in rows]
    write_lines(tmp_path / "r.csv", "t,P,e,F", *lines)
    mapmore("run", tmp_path / "record.yaml", "-q", code=0)
    page = (tmp_path / "runs" / "record" / "report" / "index.html").read_text(encoding="utf-8")
    assert "of the training recordings over time" in page
    assert "mapmore is polynomial_2, fitted to the training samples here." in page
    mapmore("figure", "record", "fit", "--curve", "r", "--data", "f.csv", "-o", "f.svg", code=0)
    assert [row["time [s]"] for row in csv_rows(Path("f.csv").read_text())][:2] == ["0", "0.05"]
