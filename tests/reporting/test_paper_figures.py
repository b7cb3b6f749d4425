"""Figures and tables for a paper: every panel a file of its own, the same bytes every time, and no
name that a reader's program obeys.
"""

import csv
import re
from dataclasses import replace

import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread
from report_builder import all_named

from mapmore_cli.domain.foreign import tex_text
from mapmore_cli.domain.models import Equation
from mapmore_cli.reporting.figures.drawing import (
    DOTS_PER_INCH,
)
from mapmore_cli.reporting.inputs import FigureStyle
from mapmore_cli.reporting.pgf import to_pgf
from mapmore_cli.reporting.report import write_report
from mapmore_cli.reporting.sections import all_tables
from mapmore_cli.reporting.table import Column, Table, to_csv, to_latex
from mapmore_cli.reporting.tables import equations_table

HOSTILE = r"\input{/etc/passwd}\write18{rm}$%&#_{}^~[2]*" + "\n\n\\def"
OBEYED = re.compile(r"(?<!\\)\\(input|write|def|include|catcode|csname|immediate|openout)\b")


@pytest.fixture(scope="module")
def paper(inputs, tmp_path_factory):
    out = tmp_path_factory.mktemp("paper")
    write_report(inputs, out, ("fit", "nrmse"), ("pdf", "png", "pgf", "svg", "tex"))
    return out


def test_every_panel_is_a_file_in_every_format_with_its_numbers(paper):
    panels = {"fit.pressure=250", "fit_training", "nrmse"}
    assert {path.name for path in (paper / "panels").iterdir()} == {
        f"{panel}.{suffix}" for panel in panels for suffix in ("pdf", "png", "pgf", "svg", "csv")
    }


def test_the_numbers_are_the_ones_that_were_drawn(paper, inputs):
    rows = list(
        csv.DictReader((paper / "panels" / "fit.pressure=250.csv").read_text().splitlines())
    )
    curve = inputs.dataset.curves[2]
    assert [float(row["strain [1]"]) for row in rows] == pytest.approx(
        curve.columns["strain"], rel=1e-11
    )
    assert [float(row["force [N]"]) for row in rows] == pytest.approx(
        curve.columns["force"], rel=1e-11
    )
    assert [float(row["sarosi [N]"]) for row in rows] == pytest.approx(
        inputs.validation.predictions["sarosi"][2], rel=1e-11
    )
    assert {row["data"] for row in rows} == {"validate"}


def test_a_panel_is_as_wide_as_the_style_says(inputs, tmp_path):
    wide = replace(inputs, style=FigureStyle(width=88 / 25.4, size=8.0))
    write_report(wide, tmp_path, ("nrmse",), ("png", "pgf"))
    assert imread(tmp_path / "panels" / "nrmse.png").shape[1] == int(88 / 25.4 * DOTS_PER_INCH)
    assert f"\\pgfqpoint{{{88 / 25.4:f}in}}" in (tmp_path / "panels" / "nrmse.pgf").read_text()


def test_no_date_and_no_program_in_a_pdf(paper):
    written = (paper / "panels" / "nrmse.pdf").read_bytes()
    for word in (b"CreationDate", b"ModDate", b"Producer", b"Creator"):
        assert word not in written


def test_names_do_nothing_in_tex(tmp_path):
    write_report(all_named(HOSTILE), tmp_path, ("fit", "nrmse"), ("pgf", "tex"))
    files = [*(tmp_path / "tables").glob("*.tex"), *(tmp_path / "panels").glob("*.pgf")]
    assert len(files) > 12
    for path in files:
        text = path.read_text(encoding="utf-8")
        labels = (
            re.sub(r"\\catcode`\\[%^]=\\active\\def[%^]\{[^\n]*?\}(?=\\catcode|[^\\])", "", text)
            if path.suffix == ".pgf"
            else text
        )
        found = [
            match[0]
            for match in OBEYED.finditer(re.sub(r"(?m)^%.*$", "", labels))
            if match[1] not in ("catcode", "def")
        ]
        assert found == [], path.name
    assert all(len(path.name) < 120 and "/" not in path.stem for path in files)


def test_a_formula_in_a_figure_is_a_formula_in_tex():
    figure = Figure()
    figure.text(0.5, 0.5, "$x_1$")
    figure.text(0.5, 0.1, "$x_2$", parse_math=False)
    written = to_pgf(figure)
    assert "$x_1$" in written
    assert r"\$x\_2\$" in written


def test_what_tex_reads_is_text():
    assert tex_text(r"\write18{rm}") == r"\textbackslash{}write18\{rm\}"
    assert tex_text("a\n\nb\x00\tc") == "a b c"
    rows = to_latex(Table("t", "x\n\\input{y}", (Column("a"),), (("[3pt]",), ("*",)))).splitlines()
    assert rows[0] == "% x{A}{5C}input{7B}y{7D}"
    assert rows[5:7] == [r"{[}3pt{]} \\", r"{*} \\"]


def test_units_and_greek_letters_are_what_any_latex_prints():
    assert tex_text("ε [µm·K/°C], ΔF ≥ 2 m³") == (
        r"\ensuremath{\epsilon} {[}\ensuremath{\mu}m\ensuremath{\cdot}K/\ensuremath{^\circ}C{]}, "
        r"\ensuremath{\Delta}F \ensuremath{\geq} 2 m\textsuperscript{3}"
    )
    assert tex_text("αβγδεζηθικλμνξπρςστυφχψωΓΔΘΛΞΠΣΥΦΨΩ²³±×·⋅°µ≤≥≈√∞–−").isascii()
    assert tex_text("Sárosi") == "Sárosi"  # what UTF-8 brings along


def test_equations_are_set_in_latex():
    names = [("pressure", r"\mathrm{pressure}"), ("p^2", "p^{2}")]
    table = equations_table(
        [Equation("a_1", *names[0])], {"pressure in Pa": [Equation("a_1", *names[1])]}
    )
    assert to_latex(table).splitlines()[1:6] == [
        r"\begin{tabular}{lp{0.375\linewidth}p{0.375\linewidth}}",
        r"\toprule",
        r"id & equation & equation with pressure in Pa \\",
        r"\midrule",
        r"a\_1 & {\raggedright\strut $\mathrm{pressure}$\strut\par} & {\raggedright\strut "
        r"$p^{2}$\strut\par} \\",
    ]
    assert to_csv(table).splitlines() == [
        "id,equation,with pressure in Pa,latex,latex with pressure in Pa",
        r"a_1,pressure,p^2,\mathrm{pressure},p^{2}",
    ]


def test_every_table_is_what_latex_can_read(paper, inputs):
    """No column too many, no brace left open, no letter that pdfLaTeX does not know, no table of
    nothing.
    """
    tables = {table.name: table for table in all_tables(inputs) if table.rows}
    assert {path.stem for path in (paper / "tables").glob("*.tex")} == set(tables)
    for name in tables:
        text = (paper / "tables" / f"{name}.tex").read_text(encoding="utf-8")
        assert text.isascii(), name
        *_, begin, top, head, middle = text[: text.index("\\midrule\n") + 9].splitlines()
        columns = len(
            re.findall(r"[lr]|p\{[\d.]+\\linewidth\}", begin.removeprefix(r"\begin{tabular}"))
        )
        rows = text[text.index("\\midrule\n") + 9 : text.index("\\bottomrule")].splitlines()
        assert (top, middle, len(rows)) == (r"\toprule", r"\midrule", len(tables[name].rows)), name
        for line in (head, *rows):
            assert line.endswith(r" \\"), name
            assert len(re.findall(r"(?<!\\)&", line)) == columns - 1, name
            bare = re.sub(r"\\[{}]", "", line)
            assert bare.count("{") == bare.count("}"), name
            assert len(re.findall(r"(?<!\\)\$", line)) % 2 == 0, name
