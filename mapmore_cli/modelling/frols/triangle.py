"""A tall dictionary folded into its triangular factor, for FROLS with explicit remainders in little memory."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.frols.blocks import Blocks


def triangle(blocks: Blocks) -> tuple[Array, Array]:
    """Triangular factor of `Z = [P y]`, (M+1, M+1), split into its P and y: `Z = Q R` with orthonormal columns of Q.

    Inner products and distances of columns of R are those of Z, therefore FROLS chooses the same terms, with the same numbers, on R as on
    Z. Unlike `Z'Z`, Householder's R loses nothing: each column is that of Z to rounding error. Blocks are folded in one after the other
    (J. Demmel et al. 2012, "Communication-optimal parallel and sequential QR and LU factorizations", sequential TSQR), so the memory is
    O(M^2 + block).
    """
    factor: Array | None = None
    for P, y in blocks():
        kept = 0 if factor is None else len(factor)
        stacked = np.empty((kept + len(y), P.shape[1] + 1), order="F")
        if factor is not None:
            stacked[:kept] = factor
        stacked[kept:, :-1], stacked[kept:, -1] = P, y
        factor = np.asarray(np.linalg.qr(stacked, mode="r"))
    assert factor is not None
    return factor[:, :-1], factor[:, -1]
