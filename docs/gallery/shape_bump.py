"""The key `fit.shape` removes a bump from the curve of the force over the strain. At 500 kPa, the
force of the model without `shape` rises by 1 N while the strain grows, but the force of the model
with `shape` falls everywhere.
"""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from muscle import save

import mapmore_cli as mm

STUDY: dict[str, Any] = {
    "cycles": {"over": "strain", "samples": 200},
    "levels": {"of": "pressure", "at": [80, 200, 350, 500]},
    "split": {"validate": {"pressure": [350]}},
    "segment": {"strain": {"method": "even", "count": 4}},
    "dictionary": [{"polynomial": {"of": ["strain"], "order": 4}}],
    "fuse": {"z_s": 0.25, "extrapolation": "continue", "hold": "none"},
    "validate": {"simple": False},
}
shape = {"pressure": "increasing", "strain": "decreasing"}
strain = np.linspace(0.07, 0.1, 200)
figure, axes = plt.subplots(layout="constrained", figsize=(5, 3))
asked: dict[str, dict[str, Any]] = {"without shape": {}, "with shape": {"shape": shape}}
for label, fit in asked.items():
    model = mm.fit(mm.example(), fit={"max_terms": 1, **fit}, **STUDY)
    axes.plot(strain, model(pressure=500, strain=strain), label=label)
axes.set(xlabel="Strain", ylabel="Force at 500 kPa (N)")
axes.legend()
save(figure, "shape_bump")
