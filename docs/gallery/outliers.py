"""A few samples with large errors (outliers) distort a least-squares fit. With `loss: bisquare`,
the fit gives outliers no weight and lists them.
"""

import matplotlib.pyplot as plt
import numpy as np
from muscle import STUDY, force, recording, save

import mapmore_cli as mm

table = recording([100, 200, 300, 400])
hit = np.random.default_rng(3).choice(len(table["force"]), len(table["force"]) // 10, replace=False)
table["force"][hit] += 400
figure, axes = plt.subplots(layout="constrained")
axes.plot(table["strain"], table["force"], ".", color="0.7", label="measured")
strain = np.linspace(0, 0.22, 200)
for loss in ("squares", "bisquare"):
    model = mm.fit(table, **(STUDY | {"fit": {"max_terms": 3, "loss": loss}}))
    at = {"pressure": np.full(200, 300.0), "strain": strain}
    axes.plot(strain, model.predict(at), label=f"{loss}, 300 kPa")
axes.plot(strain, force(np.full(200, 300.0), strain), "k:", label="truth")
axes.set(xlabel="strain", ylabel="force [N]")
axes.legend()
save(figure, "outliers")
