"""Published sections, and records that a section makes."""

import csv

import numpy as np
from pages import PUBLISHED

from mapmore_cli.annexes.motion.body import Motion, MotionSection
from mapmore_cli.annexes.motion.problem import MotionRecipe
from mapmore_cli.modelling.memory.records import Record

LISTED = PUBLISHED / "p_table_1.csv"
BOUNDARIES = (1.05, 2.35, 3.15, 3.95, 4.75)
STEP = 0.05
with LISTED.open(newline="") as _lines:
    ROWS = list(csv.DictReader(_lines))


def recipe(**settings):
    return MotionRecipe(input="input", output="displacement", step=STEP, **settings)


def coefficients(row):
    return [float(row[name]) for name in ("p1", "p2", "p3")]


def published(model):
    """One of P's four models, used directly."""
    rows = [row for row in ROWS if row["model"] == model]
    directed = rows[0]["direction"] != "all"
    sections = []
    for row in rows:
        place = max(int(row["section"]), 1)
        name = f"{row['direction']} {place}" if directed else str(place)
        sections.append(
            MotionSection(
                name,
                place,
                row["direction"],
                *coefficients(row)[:2],
                np.array(coefficients(row)[2:]),
            )
        )
    boundaries = BOUNDARIES if len(rows) >= 6 else ()
    return Motion(
        "input",
        "displacement",
        STEP,
        "hard",
        boundaries,
        directed,
        0.0,
        ("input",),
        tuple(sections),
        (0.0, 5.0),
    )


def stepped(pairs, drive, at=None):
    """Sample by sample, with a pair p1, p2 for each, from a state or from rest."""
    x1 = x2 = drive[0] / (1 - sum(pairs[0])) if at is None else at
    values = []
    for (p1, p2), now in zip(pairs, drive, strict=True):
        values.append(x1)
        x1, x2 = x2, p1 * x1 + p2 * x2 + now
    return np.array(values)


def looped(u, section, at=None):
    """The section, sample by sample."""
    return stepped([section[:2]] * len(u), section[2] * u, at)


def sine(samples=240, low=0.0, high=5.0, frequency=0.25):
    return low + (high - low) * (
        0.5 - 0.5 * np.cos(2 * np.pi * frequency * STEP * np.arange(samples))
    )


def record(u, y, training=None):
    n = len(u)
    return Record(
        {"time": STEP * np.arange(n), "input": u, "displacement": y},
        np.ones(n, dtype=bool) if training is None else training,
    )


def made_by(row, samples=240, noise=0.0):
    """A record that a published row makes, with noise."""
    u = sine(samples)
    return record(
        u,
        looped(u, coefficients(row)) + noise * np.random.default_rng(0).standard_normal(samples),
    )
