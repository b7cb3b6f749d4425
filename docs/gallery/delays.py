"""The script identifies a process with delays from a recording. The output of the process also
depends on the square of the input. The script prints the model, and the picture shows a free run
(simulation) over data that were not used for fitting.
"""

import matplotlib.pyplot as plt
import numpy as np
from muscle import save

import mapmore_cli as mm

rng = np.random.default_rng(8)
u, y = np.concatenate([[-1, 1], rng.uniform(-1, 1, 398)]), np.zeros(400)
for k in range(2, 400):
    y[k] = 0.7 * y[k - 1] - 0.2 * y[k - 2] + 0.5 * u[k - 1] + 0.1 * u[k - 2] ** 2
record = {"time": np.arange(400.0), "voltage": u, "force": y}
terms = [{"lags": {"of": ["force", "voltage"], "steps": [1, 2], "order": 2}}]
columns = {
    "time": {"column": "time"},
    "voltage": {"column": "voltage"},
    "force": {"column": "force"},
}
split = {"validate": {"last": 0.25}}
model = mm.fit(
    record,
    columns=columns,
    target={"column": "force"},
    split=split,
    dictionary=terms,
    fit={"max_terms": 4, "tolerance": 0},
)
print(model.equations[0].text)
figure, axes = plt.subplots(layout="constrained")
axes.plot(y[-100:], "k", label="measured")
axes.plot(model.predict(record)[-100:], "--", label="free run")
axes.set(xlabel="sample")
axes.legend()
save(figure, "delays")
