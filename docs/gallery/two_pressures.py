"""If a formula is the backbone of a model, curves at two pressures are enough for predictions
between these pressures, because the formula gives the shape of the curves in between.
"""

import matplotlib.pyplot as plt
import numpy as np
from muscle import STUDY, force, recording, save

import mapmore_cli as mm

table = recording([100, 300])
bare, on_formula = mm.fit(table, **STUDY), mm.fit(table, model={"backbone": "sarosi"}, **STUDY)
strain = np.linspace(0, 0.2, 100)
figure, axes = plt.subplots(layout="constrained")
truth = force(np.full(100, 200.0), strain)
axes.plot(strain, bare(pressure=200, strain=strain) - truth, label="pieces alone")
axes.plot(strain, on_formula(pressure=200, strain=strain) - truth, label="pieces on sarosi")
axes.axhline(0, color="grey")
axes.set(xlabel="strain", ylabel="error at 200 kPa [N]")
axes.legend()
save(figure, "two_pressures")
