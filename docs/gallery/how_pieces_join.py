"""With `z_s: 0`, two segment functions meet with a jump. With a larger `z_s`, one function fades
into the other in a zone. The key `extrapolation` says what the model computes beyond the data.
"""

import warnings
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from muscle import force, save

import mapmore_cli as mm

strain = np.linspace(0, 0.2, 80)
table = {"strain": strain, "force": force(np.full(80, 250.0), strain)}


def joined(**fuse: object) -> Any:
    """Two straight pieces."""
    return mm.fit(
        table,
        target="static",
        segment={"strain": {"method": "even", "count": 2}},
        dictionary=[{"polynomial": {"of": ["strain"], "order": 1}}],
        fit={"max_terms": 1},
        fuse={"transition": "linear", "hold": "none", **fuse},
    )


near, wide = np.linspace(0.04, 0.16, 401), np.linspace(-0.03, 0.25, 561)
zones = {z_s: joined(z_s=z_s)(strain=near) for z_s in (0, 0.25, 0.5)}
with warnings.catch_warnings(action="ignore"):  # that points lie beyond the data
    beyond = {
        word: joined(extrapolation=word)(strain=wide) for word in ("continue", "saturate", "zero")
    }
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3.4), layout="constrained")
for z_s, width in zip(zones, (2.4, 1.8, 1.2), strict=True):
    error = zones[z_s] - force(np.full(401, 250.0), near)
    left.plot(near, error, linewidth=width, label=f"z_s: {z_s:g}")
left.axvline(0.1, color="0.6", linestyle=":")
left.set(xlabel="strain", ylabel="model less data [N]", title="at the boundary of two segments")
for word, line in zip(beyond, ("-", "--", ":"), strict=True):
    right.plot(wide, beyond[word], line, label=f"extrapolation: {word}")
right.plot(strain[::4], table["force"][::4], "k.", markersize=3, label="data")
right.set(xlabel="strain", ylabel="force [N]", title="beyond the data")
for axes in (left, right):
    axes.legend()
save(figure, "how_pieces_join")
