"""A recording has its pressure in psi, its strain in per cent and its force in pound-force. You
write the unit of each column once, in `columns`.
"""

from muscle import STUDY, recording, save

import mapmore_cli as mm

table = recording([80, 150, 250, 350])
log = {
    "P (psi)": table["pressure"] / 6.894757,
    "stroke %": 100 * table["strain"],
    "lbf": table["force"] / 4.448222,
}
columns = {
    "pressure": {"column": "P (psi)", "unit": "psi"},
    "strain": {"column": "stroke %", "unit": "%"},
    "force": {"column": "lbf", "unit": "lbf"},
}
model = mm.fit(log, columns=columns, **STUDY)
axes = model.plot()
save(axes.figure, "psi_and_per_cent")
