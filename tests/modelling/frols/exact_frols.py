"""FROLS in arithmetic of 120 digits: what double precision is measured against."""

import mpmath


def exact_frols(P, y, k):
    """Indices in the order of selection and their ERR, of exactly the doubles in `P` and `y`.

    Elimination on the exact Gram matrix: with this many digits its squared condition number does no harm.
    """
    with mpmath.workdps(120):
        columns = [[mpmath.mpf(float(v)) for v in column] for column in (*P.T, y)]
        G = [[mpmath.fdot(a, b) for b in columns] for a in columns]
        M, yy = P.shape[1], G[-1][-1]
        chosen, errs = [], []
        for _ in range(k):
            err = {m: G[m][-1] ** 2 / G[m][m] / yy for m in range(M) if m not in chosen}
            pick = max(err, key=err.get)
            chosen.append(pick)
            errs.append(float(err[pick]))
            row = list(G[pick])
            for line in G:
                factor = line[pick] / row[pick]
                for j in range(M + 1):
                    line[j] -= factor * row[j]
    return chosen, errs
