"""Data that the tests of the formulas share."""

import numpy as np
from common import rows_of
from scipy.optimize import brentq

from mapmore_cli.modelling.literature import get, names

STATIC, DAMPING = (
    tuple(name for name in names() if get(name).component == component and not get(name).dimensions)
    for component in ("static", "damping")
)
"""Those that need nothing but the data."""

PLANTED = {
    name: {parameter: float(value) for parameter, value in map(str.split, values)}
    for name, *values in rows_of("""
chou_hannaford  c1 2.4  c2 1.8
tondu_lopez  area 1.05  theta 0.8
tondu_lopez_corrected  area 0.6  theta 0.6  a_k 3.0  b_k -1.4
kerscher  theta 0.6  a_k 3.5  b_k -1.2  a_e 0.3  b_e -0.5
none
linear_viscous  B0 -333.0
pressure_viscous  B1 -1.1
reynolds  B0_rise -284.0  B1_rise 0.42  B0_fall -518.0  B1_fall 1.1
cao  B0_rise_low -155.0  B1_rise_low -0.46  B0_rise_high -812.0  B1_rise_high 2.2  \
     B0_fall_low -525.0  B1_fall_low 1.2  B0_fall_high 66.0  B1_fall_high -1.6
tondu_kinetic_friction  B0 -40.0  B1 -25.0  B2 0.3
peternel  B0 -20.0  B1 9.0  B2 -6.0  B3 -15.0  B4 0.25
peternel_absolute  B0 -20.0  B1 -9.0  B2 -6.0  B3 -15.0  B4 0.25
""")
}
"""Parameters that a muscle may have; pressures in kPa."""

MUSCLE_LIKE = ("F", "a0", "a1", "a2", "b0", "c0", "c1")
TABLE_I = {
    "22 cm": (0.3235, 16.99, -298.0, 3600.0, -0.16, -592.32, 6430.0),
    "16 cm": (0.2849, 25.22, -267.0, 7600.0, -0.22, -499.54, 7488.0),
    "12 cm": (0.1562, 104.93, -2064.0, 80500.0, -0.36, -482.38, 6338.0),
}
"""H table I."""

WRIST = {"a1": -5.699, "a2": 158.773, "a3": -42.647, "a4": -299.482, "a5": 86.216, "a6": -196.865}
"""W's published coefficients a..f: pressure in bar, strain as a fraction, force in N."""


def uniform(seed, rows, **ranges):
    """Scattered samples of quantities between their ends."""
    rng = np.random.default_rng(seed)
    return {name: rng.uniform(low, high, rows) for name, (low, high) in ranges.items()}


def grid(pressures, strains):
    """Every pressure at every strain."""
    pressure, strain = np.meshgrid(pressures, strains)
    return {"pressure": pressure.ravel(), "strain": strain.ravel()}


def sarosi(values, p, x):
    """M2 eq 14 and W eq 12, written out."""
    a1, a2, a3, a4, a5, a6 = values
    return (a1 * p + a2) * np.exp(a3 * x) + a4 * x * p + a5 * p + a6


def muscle_like(values, p, x, v):
    """H eq 4-5, written out."""
    f, a0, a1, a2, b0, c0, c1 = values
    return p * f * (1 + a0 * x + a1 * x**2 + a2 * x**3) * (1 + b0 * v) + f * (c0 + c1 * x)


def wrist_force(columns):
    return sarosi(WRIST.values(), columns["pressure"], columns["strain"])


def wrist_points():
    """W's table rebuilt from its eq 12: the strains at 1 to 7 bar, in kPa, under 0 to 30 kg in
    steps of 2.5 kg (W section II).
    """
    pressures, loads = np.meshgrid(
        np.arange(1.0, 8.0), 9.81 * np.arange(0.0, 30.1, 2.5), indexing="ij"
    )

    def strain(pressure, load):
        return float(
            brentq(
                lambda x: wrist_force({"pressure": pressure, "strain": x}) - load,
                -0.5,
                0.5,
                xtol=1e-14,
            )
        )

    strains = np.array(
        [strain(pressure, load) for pressure, load in zip(pressures.flat, loads.flat, strict=True)]
    )
    return {"pressure": 100.0 * pressures.ravel(), "strain": strains}, loads.ravel()


def slack_muscle(seed, strains, rows=400):
    """A muscle with a slack foot, in kPa and N: a force that sets in smoothly above a threshold
    pressure, with sensor noise of 1 N.
    """
    rng = np.random.default_rng(seed)
    columns = {"pressure": rng.uniform(0, 600, rows), "strain": rng.choice(strains, rows)}
    threshold = 60.0 + 2500.0 * columns["strain"]
    rise = (
        np.sqrt((columns["pressure"] - threshold) ** 2 + 30.0**2) + columns["pressure"] - threshold
    )
    return columns, 0.3 * rise * (
        0.45 + 0.55 * np.exp(-25.0 * columns["strain"])
    ) - 5.0 + rng.standard_normal(rows)


def noisy_wrist(seed, rows=300):
    """Scattered points of W's muscle with sensor noise of 5 N."""
    rng = np.random.default_rng(seed)
    columns = {"pressure": rng.uniform(1, 7, rows), "strain": rng.uniform(0, 0.2, rows)}
    return columns, wrist_force(columns) + 5.0 * rng.standard_normal(rows)


def motion(seed, rows=400):
    """Scattered samples of step responses, in kPa, a fraction, 1/s and N; the direction is that of
    the pressure, not of the strain rate.
    """
    rng = np.random.default_rng(seed)
    return {
        "pressure": rng.uniform(0, 400, rows),
        "strain": rng.uniform(0, 0.2, rows),
        "strain_rate": rng.uniform(-2, 2, rows),
        "direction": rng.choice([-1.0, 1.0], rows),
        "load": rng.choice([42.0, 115.0, 213.0], rows),
    }


def scattered(seed, rows):
    """Pressures in kPa and strains."""
    return uniform(seed, rows, pressure=(50, 600), strain=(-0.01, 0.25))


def noisy(name, seed, rows=400, noise=3.0):
    """Scattered samples of a muscle with the planted parameters of a formula."""
    columns = motion(seed, rows) if name in DAMPING else scattered(seed, rows)
    return columns, get(name).predict(PLANTED[name], columns) + noise * np.random.default_rng(
        seed + 1000
    ).standard_normal(rows)
