"""A recording shows creep and friction. A slow state describes the creep, and a play operator
describes the friction. A static model can describe neither creep nor friction, and a linear model
with lags can describe only creep.
"""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from muscle import save

import mapmore_cli as mm

time = np.arange(0, 60, 0.1)
swing = 70 * np.sin(2 * np.pi * time / 20) + 40 * np.sin(2 * np.pi * time / 6.1)
pressure = 150 + (1 - time / 150) * swing
slow, play = np.full_like(pressure, pressure[0]), np.full_like(pressure, pressure[0])
for k in range(1, len(time)):
    slow[k] = slow[k - 1] + 0.1 / 2.0 * (pressure[k - 1] - slow[k - 1])
    play[k] = np.clip(play[k - 1], pressure[k] - 20, pressure[k] + 20)
noise = np.random.default_rng(1).normal(0, 0.05, len(time))
displacement = 0.05 * play + 0.03 * slow + noise
record = {"time": time, "pressure": pressure, "displacement": displacement}
dictionary = [
    {"slow": {"of": ["pressure"], "tau": [0.5, 1, 2, 4]}},
    {"play": {"of": ["pressure"], "widths": [0.05, 0.1, 0.2]}},
    {"polynomial": {"of": ["pressure"], "order": 1}},
]
study: dict[str, Any] = {
    "target": {"column": "displacement"},
    "units": {"displacement": "mm"},
    "split": {"validate": {"last": 0.5}},
}
model = mm.fit(record, dictionary=dictionary, fit={"max_terms": 4}, **study)
figure, axes = plt.subplots(layout="constrained")
axes.plot(time, record["displacement"], "k", label="measured")
axes.plot(time, model.predict(record), "--", label="model")
axes.set(xlabel="time [s]", ylabel="displacement [mm]")
axes.legend()
save(figure, "a_record_with_memory")
