"""Each level is left out in turn, and the model predicts the level that it has not seen. At the
outermost levels the model must extrapolate. A formula as a backbone can extrapolate, but segments
alone cannot.
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
