"""Separate the name of a quantity from its unit in the title of a column."""

from __future__ import annotations

import re

from mapmore_cli.annexes.drafting.spelling import spelt
from mapmore_cli.study.units import spell_pressures, unit_of

# A whole number in brackets is an index, as in `s[12]`, except for the unit 1 in `strain [1]`.
_BRACKETS = re.compile(r"[\[(]\s*((?<=\s[\[(])1(?=\s*[\])])|(?!\d+\s*[\])])[^\])]+?)\s*[\])]")
# brackets and signs of Chinese and Japanese texts are replaced by the ASCII characters
HALF_WIDTH = str.maketrans("（）［］／％", "()[]/%")
_BEHIND = re.compile(r"(?:[_,/]|\bin)\s*(?!\d+$)([^\s_,/]+)$")
# the unit of a rate or of a stiffness, which is no time and no length, even if it is unknown, as
# `l/min` is; other words before a stroke are symbols with their unit, for example `t/s` and `F/N`
_RATIO = re.compile(
    r"(?:\bin\s+|[\s_,])(?!t/)([^\W\d_]+/(?:s|min|h|(?:s|m+)(?:\^?[23]|[²³]))|N/m+)$"
)
_SHARE = re.compile(r"(?<!\d)(?<!\d )%")


def units_in(title: str) -> list[str]:
    """Return the texts in a title that may be units: those in brackets; at the end of the title, a
    unit with a stroke such as `mm/s`, otherwise the last word after a separator, for example `deg`
    in `angle_deg`; and a per cent sign that follows no number.
    """
    title = spell_pressures(title.translate(HALF_WIDTH))
    last = _RATIO if _RATIO.search(title) else _BEHIND
    return [text for form in (_BRACKETS, last, _SHARE) for text in form.findall(title)]


def name_in(title: str) -> str:
    """Return a title without its unit, as a name: at most 40 letters, digits and `_`."""
    bare = _BRACKETS.sub(_unless_unit, spell_pressures(title.translate(HALF_WIDTH)))
    bare = _BEHIND.sub(_unless_unit, _RATIO.sub(_unless_unit, bare))
    name = re.sub(r"\W+", "_", spelt(bare), flags=re.ASCII).strip("_")[:40]
    return f"column_{name}" if name[:1].isdigit() else name or "column"


def _unless_unit(match: re.Match[str]) -> str:
    """Return the matched text, or an empty text if its first group is a unit."""
    return "" if unit_of(match[1]) else match[0]
