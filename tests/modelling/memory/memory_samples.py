"""Recordings with known memory, and how far a run lies from the measurement; samples that are its
history have no prediction (NaN).
"""

import numpy as np

from mapmore_cli.domain.fits import MemoryModel, StateSet
from mapmore_cli.modelling.expressions import to_text
from mapmore_cli.modelling.expressions.families import products
from mapmore_cli.modelling.expressions.operator import Setting, along
from mapmore_cli.modelling.expressions.operators import OPERATORS
from mapmore_cli.modelling.memory.records import Record
from mapmore_cli.modelling.selection import MemoryRecipe

STEP = 0.01


def state_set(*names, ranges=None, low=(), high=(), margin=0.15):
    return StateSet(
        names,
        STEP,
        ranges or {},
        {},
        np.array(low, dtype=float),
        np.array(high, dtype=float),
        margin,
    )


def memory_model(terms, theta, states, constant=0.0, limits=(-1.0, 1.0)):
    theta = np.array(theta, dtype=float)
    return MemoryModel("y", states, tuple(terms), theta, np.zeros(len(theta)), constant, limits)


def recipe_of(target, dictionary, step=STEP, *, max_terms, **changed):
    """Plain FROLS of so many terms, but for what is `changed`."""
    plain = {"scaling": "none", "tolerance": 0.0, "ordered": False}
    return MemoryRecipe(
        target=target,
        dictionary=tuple(dictionary),
        step=step,
        max_terms=max_terms,
        **{**plain, **changed},
    )


def texts(of, order, **options):
    """Products as a dictionary has them."""
    return tuple(to_text(term) for term in products(of, order, **options))


def record(training=True, **columns):
    n = len(next(iter(columns.values())))
    return Record(columns, np.broadcast_to(np.asarray(training, dtype=bool), (n,)))


def wandering(n, seed=0):
    """An input that moves smoothly up and down."""
    rng = np.random.default_rng(seed)
    walk = np.cumsum(rng.normal(0, 0.3, n + 40))
    return np.convolve(walk, np.ones(41) / 41, "valid") + np.sin(np.arange(n) / 25)


def narx_truth(x, y0=0.0, y1=0.0):
    """y[k] = 0.6 x[k-2] - 0.5 y[k-2] + 0.7 x[k-1] y[k-1] + 0.2 y[k-1]^2."""
    y = np.zeros(len(x))
    y[:2] = y0, y1
    for k in range(2, len(x)):
        y[k] = 0.6 * x[k - 2] - 0.5 * y[k - 2] + 0.7 * x[k - 1] * y[k - 1] + 0.2 * y[k - 1] ** 2
    return y


def slow(x, tau, step):
    """A first-order lag of x."""
    return along(OPERATORS["slow"], x, Setting((tau,), step))


def resonance(x, frequency, damping, step):
    """Position of the oscillator that x drives."""
    return along(OPERATORS["resonance"], x, Setting((frequency, damping), step))
