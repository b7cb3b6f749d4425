"""Convert the names of colours in figures to colours of SVG, and provide colour maps, without
Matplotlib.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array

MAPS = {
    "Blues": "f7fbff deebf7 c6dbef 9ecae1 6baed6 4292c6 2171b5 08519c 08306b",
    "RdBu_r": "053061 2166ac 4393c3 92c5de d1e5f0 f7f7f7 fddbc7 f4a582 d6604d b2182b 67001f",
    "viridis": "440154 482878 3e4989 31688e 26828e 1f9e89 35b779 6ece58 b5de2b fde725",
}
"""Colour maps by name, each as a list of colours at equal distances. They are from ColorBrewer and
Matplotlib (viridis).
"""


def colour_at(name: str, share: float) -> str:
    """Return the colour at the fraction `share` (0 to 1) of a colour map, as `#rrggbb`."""
    colours = np.array([list(bytes.fromhex(one)) for one in MAPS[name].split()], dtype=float)
    place = np.clip(share, 0.0, 1.0) * (len(colours) - 1)
    below = min(int(place), len(colours) - 2)
    mixed = colours[below] + (place - below) * (colours[below + 1] - colours[below])
    return "#" + bytes(round(one) for one in mixed).hex()


def hex_of(colour: Any) -> str:
    """Return a colour in a form that SVG accepts. A grey such as `0.3`, which only Matplotlib
    accepts, is converted. Raises TypeError for a colour that is not a text.
    """
    if not isinstance(colour, str):
        raise TypeError(f"{colour!r} is not the name of a colour")
    if colour.replace(".", "", 1).isdigit():
        return "#" + bytes([round(255 * float(colour))] * 3).hex()
    return colour


@dataclass(frozen=True)
class Shades:
    """Colours for values. Each band between two neighbouring `levels`, (n,), has one colour of the
    colour map `cmap`.
    """

    cmap: str
    levels: Array

    def of(self, values: Any) -> list[str]:
        """Return the colour of each value. The colour of NaN is an empty text."""
        bands = len(self.levels) - 1
        places = np.clip(np.searchsorted(self.levels, values, side="right") - 1, 0, bands - 1)
        shares = places / max(bands - 1, 1)
        known = np.isfinite(values)
        return [
            colour_at(self.cmap, share) if finite else ""
            for share, finite in zip(shares, known, strict=True)
        ]
