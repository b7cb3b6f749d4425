"""The script calls the algorithm FROLS directly, without a spec. FROLS chooses the terms of a model
one by one, and the picture shows their error reduction ratios in the order of the choice.
"""

import matplotlib.pyplot as plt
import numpy as np
from muscle import save

import mapmore_cli as mm

rng = np.random.default_rng(4)
X = rng.uniform(-1, 1, (300, 3))
y = 2 * X[:, 0] * X[:, 1] - X[:, 2] ** 3 + 0.3 * X[:, 0] + 0.05 * rng.normal(size=300)
model = mm.FROLS(order=3, max_terms=6).fit(X, y)
print(model.equations_[0])
figure, axes = plt.subplots(layout="constrained")
axes.bar(model.terms_, model.err_)
axes.set(ylabel="error reduction ratio", yscale="log")
save(figure, "terms_by_ratio")
