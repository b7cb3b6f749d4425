"""Two campaigns of measurements of one muscle are compared. The picture shows three answers: the
muscle has changed, the muscle is the same, or the data cannot tell.
"""

import matplotlib.pyplot as plt
from muscle import STUDY, recording, save

import mapmore_cli as mm
from mapmore_cli.modelling.validation.comparison import compare

before = mm.fit(recording([80, 150, 200, 250, 350], seed=1), **STUDY).model
figure, axes = plt.subplots(layout="constrained")
for place, (factor, noise) in enumerate([(1.0, 1.0), (1.0, 60.0), (1.04, 1.0)]):
    table = recording([80, 150, 200, 250, 350], noise=noise, seed=2 + place)
    found = compare(before, mm.fit({**table, "force": factor * table["force"]}, **STUDY).model)
    low, high = found.interval
    axes.errorbar(
        found.ratio, place, xerr=[[found.ratio - low], [high - found.ratio]], fmt="o", capsize=4
    )
    axes.text(found.ratio, place + 0.12, found.answer)
axes.axvspan(0.99, 1.01, color="#dddddd")
axes.set(
    xlabel="force, times that of before (grey: the margin)",
    yticks=[],
    ylim=(-0.5, 2.6),
    xlim=(0.98, 1.05),
)
save(figure, "has_it_changed")
