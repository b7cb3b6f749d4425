"""A model is exported as a lookup table with a mask. The mask marks the points inside the training
range; at all other points the model extrapolates.
"""

import matplotlib.pyplot as plt
import numpy as np
from muscle import STUDY, recording, save

import mapmore_cli as mm

table = recording([80, 150, 250, 350])
table = {
    name: values[table["strain"] < 0.05 + table["pressure"] / 2200]
    for name, values in table.items()
}
model = mm.fit(table, **STUDY)
pressure, strain = np.meshgrid(np.linspace(50, 400, 71), np.linspace(0, 0.25, 51), indexing="ij")
valid = ~model.outside_range(pressure=pressure, strain=strain)
figure, axes = plt.subplots(layout="constrained")
axes.contourf(pressure, strain, valid, levels=[-0.5, 0.5, 1.5], colors=["#dddddd", "#9ecae1"])
axes.plot(table["pressure"], table["strain"], "k.", markersize=2)
axes.set(xlabel="pressure [kPa]", ylabel="strain", title="valid (blue) and extrapolated (grey)")
save(figure, "validity")
