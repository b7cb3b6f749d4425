"""Draw the formulas of pages (`$...$` and `$$...$$`), so that the site needs no network.

A forge sets them by itself. Here Matplotlib's own TeX parser draws each of them as SVG in the
colour of the text.
"""

from __future__ import annotations

import re
from functools import cache
from io import BytesIO
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.mathtext import MathTextParser

SIZE = 11
FENCE = re.compile(r"^ *```.*?^ *```|`[^`\n]+`", re.MULTILINE | re.DOTALL)
FORMULA = re.compile(r"\$\$(?P<block>.+?)\$\$|\$(?P<inline>[^\s$](?:[^$\n]*[^\s$])?)\$", re.DOTALL)
MARK = re.compile(r'<span class="formula-(inline|block)">([0-9a-f]+)</span>')


@cache
def picture(formula: str) -> str:
    """Return a formula as SVG on the line of the text; raise ValueError if it cannot be parsed."""
    text = f"${' '.join(formula.split())}$"
    font = FontProperties(size=SIZE)
    with mpl.rc_context({"mathtext.fontset": "stix", "svg.fonttype": "path"}):
        width, height, depth, *_ = MathTextParser("path").parse(text, prop=font)
        figure = Figure(figsize=(width / 72, height / 72))
        figure.text(0, depth / height, text, fontproperties=font)
        file = BytesIO()
        figure.savefig(file, format="svg", transparent=True, metadata={"Date": None})
    svg = file.getvalue().decode()
    rest = r"<metadata>.*?</metadata>|<style.*?</style>|<!--.*?-->"  # a style would be the page's
    svg = re.sub(rest, "", svg[svg.index("<svg") :], flags=re.DOTALL)
    em = f"{1.05 * height / SIZE:.3f}em"
    style = f"height:{em};vertical-align:{-1.05 * depth / SIZE:.3f}em;fill:currentColor"
    svg = re.sub(r'(<svg[^>]*?) (?:width|height)="[^"]*"', r"\1", svg)
    svg = re.sub(r'(<svg[^>]*?) (?:width|height)="[^"]*"', r"\1", svg)
    return " ".join(svg.replace("<svg", f'<svg class="formula" style="{style}"', 1).split())


def marked(markdown: str) -> str:
    """Return the text of a page with a mark in the place of each formula outside of code.

    The mark holds the TeX in hexadecimal digits, which Markdown leaves as they are.
    """

    def mark(match: re.Match[str]) -> str:
        kind = "block" if match["block"] else "inline"
        tex = (match["block"] or match["inline"]).encode().hex()
        return f'<span class="formula-{kind}">{tex}</span>'

    parts, start = [], 0
    for code in FENCE.finditer(markdown):
        parts += [FORMULA.sub(mark, markdown[start : code.start()]), code[0]]
        start = code.end()
    return "".join([*parts, FORMULA.sub(mark, markdown[start:])])


def drawn(html: str) -> str:
    """Return HTML with a picture in the place of each mark."""

    def draw(match: re.Match[str]) -> str:
        svg = picture(bytes.fromhex(match[2]).decode())
        block = match[1] == "block"
        return f'<span style="display:block;overflow-x:auto">{svg}</span>' if block else svg

    return MARK.sub(draw, html)


def on_page_markdown(markdown: str, **_rest: Any) -> str:
    """Mark the formulas before Markdown sees them."""
    return marked(markdown)


def on_page_content(html: str, **_rest: Any) -> str:
    """Draw them when the page is HTML."""
    return drawn(html)
