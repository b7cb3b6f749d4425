"""Beyond the measured range, the force of a polynomial model can rise again when the strain grows.
With the key `fit.shape`, the force falls with growing strain, also beyond the measured range, up to
a distance that you set with the key `beyond`.
"""

import warnings

import matplotlib.pyplot as plt
import numpy as np
from muscle import STUDY, force, recording, save

import mapmore_cli as mm

table = recording([100, 200, 300], noise=8.0, count=12)
table = {name: column[table["strain"] < 0.15] for name, column in table.items()}
study = {**STUDY, "segment": {}, "fuse": {"extrapolation": "continue"}}
shape = {"shape": {"pressure": "increasing", "strain": "decreasing"}, "beyond": 0.3}
plain = mm.fit(table, **{**study, "fit": {"max_terms": 5}})
shaped = mm.fit(table, **{**study, "fit": {"max_terms": 5, **shape}})
strain = np.linspace(0, 0.18, 200)
warnings.simplefilter("ignore")  # that points lie outside of the training range
figure, axes = plt.subplots(layout="constrained")
axes.plot(strain, force(np.full(200, 200.0), strain), color="grey", label="muscle")
axes.plot(strain, plain(pressure=200, strain=strain), label="order four")
axes.plot(strain, shaped(pressure=200, strain=strain), label="with its shape")
axes.axvspan(0.14, 0.18, color="0.95", label="beyond the data")
axes.set(xlabel="strain", ylabel="force at 200 kPa [N]")
axes.legend()
save(figure, "a_force_that_rises")
