"""Prediction intervals (bands) contain a sample of a new curve with a probability of 95 %. To
compute the intervals, the curve of each level that lies between two others is left out in turn.
"""

from muscle import STUDY, recording, save

import mapmore_cli as mm

model = mm.fit(recording([80, 150, 200, 250, 350], noise=6), **STUDY)
axes = model.plot(interval=0.95)
save(axes.figure, "bands")
