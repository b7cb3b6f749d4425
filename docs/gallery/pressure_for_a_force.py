"""The inverse of a model finds the pressure that gives 200 N at each strain."""

import matplotlib.pyplot as plt
import numpy as np
from muscle import STUDY, recording, save

import mapmore_cli as mm

model = mm.fit(recording([80, 150, 200, 250, 350]), **STUDY)
strain = np.linspace(0, 0.18, 60)
found = model.invert("pressure", force=200, strain=strain)
figure, axes = plt.subplots(layout="constrained")
axes.plot(strain, found.picked)
axes.set(xlabel="strain", ylabel="pressure for 200 N [kPa]")
save(figure, "pressure_for_a_force")
