"""Synthetic muscles and rigs, whose equations are none of the fitted models' forms.

A muscle (`mckibben`, `peano`) gives a static force; `hysteresis` adds friction; an experiment (`load_cycle`) moves the muscle and returns
the truth; `sensors` turn truth into readings. A further muscle or experiment is a further file.
"""
