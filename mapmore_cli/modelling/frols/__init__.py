"""Select terms by forward regression with orthogonal least squares (FROLS), the engine of MAPMORE.

Sources: Veale, Xie and Anderson (M1 eq 2-4, M2 eq 2-8); S. A. Billings, *Nonlinear System
Identification*, Wiley 2013, chapter 3.

`frols` selects the same terms as the textbook method (`tests/modelling/frols/textbook.py`), but is
faster and more accurate numerically. `select` makes the greedy choice. `remainders` computes, in
two ways, the part of each candidate that is orthogonal to the chosen terms (its remainder).
"""

from mapmore_cli.modelling.frols.engine import (
    Regression,
    frols,
    frols_together,
    reads_once,
)
from mapmore_cli.modelling.frols.remainders import TIE_TOLERANCE
from mapmore_cli.modelling.frols.weighing import Weighing

__all__ = [
    "TIE_TOLERANCE",
    "Regression",
    "Weighing",
    "frols",
    "frols_together",
    "reads_once",
]
