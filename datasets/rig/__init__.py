"""Synthetic muscles and rigs, whose equations are none of the fitted models' forms.

`muscle` has what every muscle has, `static_muscles` the two kinds; `air` and `water` fill them. An
experiment (`load_cycle`, `step_response`, `waveform`, `random_velocity`, `antagonists`) moves a
muscle and returns the truth; `sensors` turn truth into readings.
"""
