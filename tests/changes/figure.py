"""A figure: predicted over measured values, which is the template of a plug-in put into our
folder; its place on the page is a line of the page's order.
"""

from pathlib import Path

TEMPLATE = Path(__file__).parents[2] / "docs/examples/plugin/mapmore_template/figure.py"
FILE, ORDER = "reporting/figures/scatter.py", "reporting/order.py"
ROW = '    "convergence": "nrmse",\n'
DRAWN = {FILE: TEMPLATE.read_text(encoding="utf-8")}
PLACED = {ORDER: [(ROW, f'{ROW}    "scatter": "fit",\n')]}
PATCH = {**DRAWN, **PLACED}
WORKS = """
from mapmore_cli.reporting.order import FIGURES
from mapmore_cli.reporting.figures import scatter
from mapmore_cli.study.sections.report import Report
assert "scatter" in Report().figures and callable(scatter.draw)
"""
TEST = "reporting/test_reporting_page.py::test_figures_and_sections_have_their_files"
ASTRAY = {ORDER: [(ROW, f'{ROW}    "scatter": "fitt",\n')]}
HALVES = {
    "that is not drawn": (PLACED, TEST),
    "without a place": (DRAWN, TEST),
    "in no section": ({**DRAWN, **ASTRAY}, TEST),
}
