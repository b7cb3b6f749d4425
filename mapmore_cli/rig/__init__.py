"""Synthetic muscles and rigs, whose equations are none of the fitted models' forms.

A muscle (`mckibben`, `chamber.Peano`) gives a static force; `muscle` adds friction; `chamber` and `wet_muscle` put it at the end
of a water line. An experiment (`load_cycle`, `step_response`, `waveform`) moves the muscle and returns the truth; `sensors` turn
truth into readings. A further muscle or experiment is a further file.
"""
