"""When should you stop adding terms? From noisy data, the information criterion `bic` finds the two
terms of the true model.
"""

import matplotlib.pyplot as plt
import numpy as np
from muscle import save

import mapmore_cli as mm

rng = np.random.default_rng(6)
X = rng.uniform(-1, 1, (200, 2))
y = X[:, 0] ** 2 - 0.5 * X[:, 1] + 0.2 * rng.normal(size=200)
sizes = range(1, 10)
figure, axes = plt.subplots(layout="constrained")
axes.plot(
    sizes,
    [1 - mm.FROLS(order=4, max_terms=k, tolerance=0).fit(X, y).score(X, y) for k in sizes],
    "o-",
    label="unexplained",
)
chosen = mm.FROLS(order=4, tolerance=0, stop="bic", max_terms=9).fit(X, y)
axes.axvline(len(chosen.terms_), color="k", linestyle=":", label=f"bic: {', '.join(chosen.terms_)}")
axes.set(xlabel="terms", ylabel="1 - R²")
axes.legend()
save(figure, "how_many_terms")
