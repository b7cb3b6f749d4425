"""Sárosi's hysteresis loss: critical damping `2 sqrt(|k_t| m)`, the share zeta of it, times the muscle's velocity.

M2 eq 19 multiplies by the strain rate though k_t is per metre (eq 20), so that its unit is N/m; with the length it is a force.
"""

from mapmore_cli.modelling.literature.hysteresis_loss import hysteresis_loss

FORMULA = hysteresis_loss(
    "sarosi_hysteresis_loss",
    "Sárosi, hysteresis loss",
    "M2 eq 17-23, times the length",
    "-2*zeta*sqrt(abs(stiffness)*load/9.81)*length*strain_rate",
)
