"""A record with memory: a slow state explains creep that no static model can."""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from muscle import save

import mapmore_cli as mm

time = np.arange(0, 60, 0.1)
pressure = 150 + 100 * np.sign(np.sin(2 * np.pi * time / 20))
slow = np.zeros_like(pressure)
for k in range(1, len(time)):
    slow[k] = slow[k - 1] + 0.1 / 2.0 * (pressure[k - 1] - slow[k - 1])
record = {"time": time, "pressure": pressure, "displacement": 0.05 * pressure + 0.03 * slow}
dictionary = [
    {"slow": {"of": ["pressure"], "tau": [0.5, 1, 2, 4]}},
    {"polynomial": {"of": ["pressure"], "order": 1}},
]
study: dict[str, Any] = {
    "target": {"column": "displacement"},
    "units": {"displacement": "mm"},
    "split": {"validate": {"last": 0.5}},
}
model = mm.fit(record, dictionary=dictionary, fit={"max_terms": 3}, **study)
figure, axes = plt.subplots(layout="constrained")
axes.plot(time, record["displacement"], "k", label="measured")
axes.plot(time, model.predict(record), "--", label="model")
axes.set(xlabel="time [s]", ylabel="displacement [mm]")
axes.legend()
save(figure, "a_record_with_memory")
