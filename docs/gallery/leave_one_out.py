"""Every level left out in turn: the error at each, of a model that has not seen it. The outer
levels are extrapolated, which a formula as backbone can do and pieces alone cannot.
"""

import matplotlib.pyplot as plt
from muscle import STUDY, recording, save

import mapmore_cli as mm

model = mm.fit(
    recording([80, 120, 160, 200, 250, 300, 350]),
    split={"leave_one_level_out": True},
    model={"backbone": "sarosi"},
    **STUDY,
)
rows = [
    row
    for row in model.scores
    if (row["model"], row["split"]) == ("mapmore", "validate") and row["curve"] != "all"
]
figure, axes = plt.subplots(layout="constrained")
axes.bar([row["curve"].removeprefix("pressure=") for row in rows], [row["rmse"] for row in rows])
axes.set(xlabel="pressure left out [kPa]", ylabel="RMSE there [N]")
save(figure, "leave_one_out")
