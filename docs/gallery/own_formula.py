"""A formula of your own is compared with two formulas of the literature and with a model of
segments.
"""

import matplotlib.pyplot as plt
from muscle import STUDY, recording, save

import mapmore_cli as mm

MINE = {
    "name": "ours",
    "source": "laboratory notes",
    "expression": "k*(pressure - p0)*(1 - c*strain)^2 + s*exp(-strain/e0)",
    "parameters": {
        "k": {},
        "s": {},
        "p0": {"bounds": [0.1, 60]},
        "c": {"bounds": [0.5, 10]},
        "e0": {"bounds": [0.002, 0.2]},
    },
}
model = mm.fit(
    recording([80, 150, 200, 250, 350]),
    formulas=[MINE],
    split={"validate": {"pressure": [200]}},
    validate={"against": ["ours", "sarosi", "bolen"]},
    **STUDY,
)
rows = {
    row["model"]: 100 * row["nrmse"]
    for row in model.scores
    if row["split"] == "validate" and row["curve"] == "all"
}
figure, axes = plt.subplots(layout="constrained")
axes.barh(list(rows), list(rows.values()))
axes.set(xlabel="NRMSE on held-out data [%]")
save(figure, "own_formula")
