"""Sárosi's hysteresis loss as M2 eq 19-20 print it, without the muscle's length: `1/length` times `sarosi_hysteresis_loss`."""

from mapmore_cli.modelling.literature.hysteresis_loss import hysteresis_loss

FORMULA = hysteresis_loss(
    "sarosi_hysteresis_loss_printed",
    "Sárosi, hysteresis loss, printed",
    "M2 eq 17-23",
    "-2*zeta*sqrt(abs(stiffness)*load/9.81)*strain_rate",
)
