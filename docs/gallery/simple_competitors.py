"""Every model is compared with simple competitors, which are planes, quadratic and cubic
polynomials in its inputs, its backbone alone, and formulas.
"""

import matplotlib.pyplot as plt
from muscle import STUDY, recording, save

import mapmore_cli as mm

split = {"validate": {"pressure": [200]}}
against = {"against": ["sarosi", "tondu_lopez"]}
model = mm.fit(
    recording([80, 150, 200, 250, 350]),
    split=split,
    model={"backbone": "sarosi_hinged"},
    validate=against,
    **STUDY,
)
rows = sorted(
    (r["rmse"], r["model"])
    for r in model.scores
    if r["split"] == "validate" and r["curve"] == "all"
)
figure, axes = plt.subplots(layout="constrained")
axes.barh([name for _, name in rows], [error for error, _ in rows])
axes.set(xlabel="RMSE on held-out data [N]")
save(figure, "simple_competitors")
