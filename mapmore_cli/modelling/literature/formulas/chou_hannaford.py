"""Chou and Hannaford's static force of a braided cylinder, from the conservation of energy.

W eq 3, `F = P b^2 (3 L^2/b^2 - 1)/(4 pi n^2)` with the thread length b, the number n of its turns
and the length L = L0 (1 - strain), has one lumped parameter for each power of L, and is linear in
them:

    c1 = 3 L0^2/(4 pi n^2),   c2 = b^2/(4 pi n^2),   so   n = L0 sqrt(3/(4 pi c1)),   b = L0 sqrt(3
    c2/c1).

No dimension of the muscle is needed for the force. In kPa and N both are in 1e-3 m^2. A braid has
c1 > 0 and c2 > c1/3 (b > L0); the fit does not ask for that, and `tondu_lopez`, which does, is then
the same within its bounds.
"""

from mapmore_cli.modelling.literature.formula import Formula

FORMULA = Formula(
    name="chou_hannaford",
    title="Chou and Hannaford",
    reference="W eq 3",
    inputs=("pressure", "strain"),
    parameters=("c1", "c2"),
    text="pressure*(c1*(1 - strain)^2 - c2)",
)
