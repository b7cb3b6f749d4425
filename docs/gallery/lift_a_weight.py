"""The exported Python file of a model is used in a simulation. A weight of 12 kg hangs on the
muscle, and the pressure jumps.
"""

from typing import Any

import matplotlib.pyplot as plt
from muscle import STUDY, recording, save

import mapmore_cli as mm
from mapmore_cli.annexes.exporting.exports import exported

model = mm.fit(recording([80, 150, 200, 250, 350]), name="muscle", **STUDY).model
code: dict[str, Any] = {}
exec(exported(model, "py")["muscle.py"], code)  # in practice: import muscle
strain, speed, step, length, course = 0.05, 0.0, 0.0005, 0.2, []
for k in range(8000):
    pressure = 150.0 if k < 4000 else 300.0
    speed += step * ((code["force"](pressure, strain) - 12 * 9.81) / 12 / length - 20 * speed)
    strain += step * speed
    course.append(strain)
figure, axes = plt.subplots(layout="constrained")
axes.plot([step * k for k in range(8000)], course)
axes.set(xlabel="time [s]", ylabel="strain")
save(figure, "lift_a_weight")
