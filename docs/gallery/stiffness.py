"""The stiffness of the muscle is the derivative of the modelled force with respect to the strain,
with the opposite sign. The picture shows the stiffness at three pressures.
"""

import matplotlib.pyplot as plt
import numpy as np
from muscle import STUDY, recording, save

import mapmore_cli as mm

model = mm.fit(
    recording([80, 150, 200, 250, 350], noise=0.5), fuse={"transition": "cubic"}, **STUDY
)
strain = np.linspace(0.01, 0.2, 100)
figure, axes = plt.subplots(layout="constrained")
for pressure in (100, 200, 300):
    axes.plot(
        strain,
        -model.derivatives(pressure=pressure, strain=strain)["strain"],
        label=f"{pressure} kPa",
    )
axes.set(xlabel="strain", ylabel="stiffness, -dF/dstrain [N]")
axes.legend()
save(figure, "stiffness")
