"""Write the page of a draft. For every column, the page shows a drawing of its values and the
quantity that it is assumed to be.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from mapmore_cli.annexes.drafting.draft import Draft, range_of, scaled
from mapmore_cli.domain.arrays import Array

if TYPE_CHECKING:
    from markupsafe import Markup

# number of points of a drawing, and its width and height in pixels
POINTS, WIDTH, HEIGHT = 600, 400, 200


def draft_page(draft: Draft) -> str:
    """Return the page of a draft as HTML: every column with a drawing of its values, its role, and
    the open questions. All texts are escaped.
    """
    from mapmore_cli.reporting.table import environment

    names = {
        entry["column"]: name for name, entry in draft.data["columns"].items() if "column" in entry
    }
    drawn = {name: draft.raw[column] for column, name in names.items() if column in draft.raw}
    up = drawn.get(draft.output, ())
    across = {
        name: values
        for name, values in drawn.items()
        if name not in ("time", draft.output) and list(map(len, values)) == list(map(len, up))
    }
    page = environment().get_template("guesses.html")
    return page.render(
        draft=draft,
        names=names,
        up=up,
        across=across,
        drawing=drawing,
        range_of=range_of,
    )


def drawing(up: Sequence[Array], across: Sequence[Array] | None = None) -> Markup:
    """Return a small drawing (SVG) of one column, with all recordings one after the other. The
    horizontal axis is the column `across`, or the number of the sample if `across` is None.
    """
    from markupsafe import Markup

    y = scaled(np.concatenate(up))
    x = np.linspace(0, 1, len(y)) if across is None else scaled(np.concatenate(across))
    rows = np.linspace(0, len(y) - 1, min(POINTS, len(y))).astype(int)
    places = zip(WIDTH * x[rows], HEIGHT - HEIGHT * y[rows], strict=True)
    path = "M" + " L".join(f"{a:.1f} {b:.1f}" for a, b in places)
    box = f'viewBox="-2 -2 {WIDTH + 4} {HEIGHT + 4}" preserveAspectRatio="none" aria-hidden="true"'
    return Markup(f'<svg class="thumbnail" {box}><path d="{path}"/></svg>')
