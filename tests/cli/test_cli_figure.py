"""`mapmore figure`: one panel of a finished run."""

from __future__ import annotations

import csv

from cli_samples import write_study


def test_one_curve_as_pdf_with_its_numbers(finished, tmp_path, mapmore):
    _, runs = finished
    arguments = (
        "fit",
        "--curve",
        "200",
        "-o",
        tmp_path / "fig3.pdf",
        "--data",
        tmp_path / "fig3.csv",
    )
    result = mapmore("figure", runs / "bench", *arguments)
    assert (result.exit_code, result.stderr) == (0, "")
    assert (tmp_path / "fig3.pdf").read_bytes().startswith(b"%PDF")
    rows = list(csv.DictReader((tmp_path / "fig3.csv").read_text().splitlines()))
    assert len(rows) == 40
    assert {"strain [1]", "force [N]", "data", "mapmore [N]", "polynomial_2 [N]"} <= set(rows[0])
    first = (tmp_path / "fig3.pdf").read_bytes()
    mapmore("figure", "bench", *arguments, "--runs", runs, code=0)
    assert (tmp_path / "fig3.pdf").read_bytes() == first


def test_the_looks_of_one_figure(finished, tmp_path, mapmore):
    for curve, out in (
        ("100 kPa", "fig1.svg"),
        ("200", "fig2.svg"),
    ):  # 100 kPa trains, and has no panel of its own on the page
        styles = ("width=120 mm", "labels={force: Pull (N)}", "font=No Font")
        looks = [word for style in styles for word in ("--set", f"report.style.{style}")]
        result = mapmore(
            "figure",
            finished[1] / "bench",
            "fit",
            "--curve",
            curve,
            "-o",
            tmp_path / out,
            *looks,
            code=0,
        )
        assert result.stderr == (
            "warning: report.style.font: 'No Font' is not installed here; PDF and PNG "
            "figures are set in another font\n"
        )
        text = (tmp_path / out).read_text()
        assert f'width="{120 / 25.4 * 72:.6g}' in text
        assert "Pull (N)" in text


def test_the_style_of_the_spec(tmp_path, mapmore):
    spec = write_study(tmp_path)
    style = "{width: 88 mm, size: 8, font: No Such Font, labels: {strain: '$\\varepsilon$ (1)'}}"
    report = f"report: {{figures: [fit], formats: [pdf, tex], style: {style}"
    text = spec.read_text().replace("report: {figures: [], formats: [html, csv]", report)
    spec.write_text(text)
    mapmore(
        "run",
        spec,
        "--runs",
        tmp_path / "runs",
        code=0,
        says="'No Such Font' is not installed here",
    )
    names = {path.name for path in (tmp_path / "runs" / "bench" / "report" / "panels").iterdir()}
    assert names == {
        "fit.pressure=200.pdf",
        "fit.pressure=200.csv",
        "fit_training.pdf",
        "fit_training.csv",
    }
    assert (
        r"\toprule"
        in (tmp_path / "runs" / "bench" / "report" / "tables" / "scores.tex").read_text()
    )
    spec.write_text(text.replace(r"\varepsilon", r"\input{x}"))
    mapmore(
        "run", spec, "--runs", tmp_path / "runs", "-q", code=3, says="report.style.labels.strain"
    )


def test_the_models_that_are_named_are_drawn_and_no_others(finished, tmp_path, mapmore):
    arguments = (
        "fit",
        "--curve",
        "200",
        "-o",
        tmp_path / "a.svg",
        "--data",
        tmp_path / "a.csv",
        "--models",
        "cubic, plane",
    )
    mapmore("figure", finished[1] / "bench", *arguments, code=0)
    head = (tmp_path / "a.csv").read_text().splitlines()[0]
    assert "mapmore [N]" in head
    assert "polynomial_2" not in head
    assert "polynomial_2" not in (tmp_path / "a.svg").read_text()
    assert any(name in head for name in ("plane [N]", "cubic [N]"))
