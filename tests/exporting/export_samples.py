"""Models of every kind, made by hand."""

from dataclasses import replace
from itertools import product

import numpy as np

from mapmore_cli.annexes.motion.body import Motion, MotionSection, StateSpace
from mapmore_cli.annexes.sums import Part, Sum
from mapmore_cli.domain.fits import FormulaFit, MemoryModel, Scaling, StateSet
from mapmore_cli.domain.models import (
    CurveFunction,
    Formula,
    Fusion,
    Memory,
    Model,
    Pieces,
    SegmentFunction,
)
from mapmore_cli.domain.recording import CurveRange, Quantity
from mapmore_cli.modelling import literature

FORCE, PRESSURE, STRAIN = (
    Quantity("force", "N"),
    Quantity("pressure", "kPa"),
    Quantity("strain", "1"),
)
LEVELS = (100.0, 200.0, 350.0, 500.0)
SOURCES = ("pressure", "pressure[k-2]", "slow(pressure, 0.05)", "force[k-1]", "force[k-2]")


def segment(
    cell,
    terms,
    samples,
    seed,
):
    rng = np.random.default_rng(seed)
    names = tuple(samples)
    slope = np.array([1 / (high - low) for low, high in samples.values()])
    intercept = np.array([-low / (high - low) for low, high in samples.values()])
    k = len(terms)
    theta = rng.uniform(-1, 1, k)
    scaling = Scaling(
        "unit_square", "-", names, slope, intercept, 80.0, float(rng.uniform(20, 300))
    )
    nothing = np.zeros(k)
    return SegmentFunction(
        theta,
        nothing,
        nothing,
        nothing,
        50,
        1.0,
        "max_terms",
        f"s{cell}",
        cell,
        terms,
        scaling,
        dict(samples),
    )


def curve(number, level, counts, terms):
    """A curve over `counts` segments along each variable, which grows longer with its number."""
    ends = {
        name: (0.01 * number, 0.2 + 0.05 * number) if name == "strain" else (-1.0, 1.0 + number)
        for name in counts
    }
    boundaries = tuple(
        np.linspace(*ends[name], count + 1) ** (1 if name == "speed" else 1.0)
        for name, count in counts.items()
    )
    segments = []
    for seed, cell in enumerate(product(*(range(1, count + 1) for count in counts.values()))):
        samples = {
            name: (float(b[i - 1]), float(b[i]) - 0.02 * (i % 2))
            for (name, b), i in zip(zip(counts, boundaries, strict=True), cell, strict=True)
        }
        segments.append(segment(cell, terms, samples, 100 * number + seed))
    limits = dict(ends)
    if level is not None:
        limits["pressure"] = (level - 2.0, level + 2.0)
    return CurveFunction(
        f"c{number}",
        level,
        limits,
        boundaries,
        tuple(segments),
    )


def pieces(
    *,
    levels=LEVELS,
    counts=None,
    terms=("1", "strain", "strain^3", "exp(strain)"),
    transition="cubic",
    z_s=0.25,
    sides=("saturate", "saturate"),
    level_sides=("continue", "continue"),
    shrink=1.0,
    backbone=None,
):
    counts = counts or {"strain": 3}
    curves = tuple(curve(i, level, counts, terms) for i, level in enumerate(levels or (None,)))
    extrapolation = {**dict.fromkeys(counts, sides), "pressure": level_sides}
    fusion = Fusion(
        transition=transition,
        z_s=z_s,
        extrapolation=extrapolation,
        shrink=shrink,
    )
    names = sorted(
        {
            *counts,
            *(["pressure"] if levels else []),
            *(literature.get(backbone.name).inputs if backbone else ()),
        }
    )
    units = {"pressure": "kPa", "strain": "1", "speed": "1/s"}
    body = Pieces("pressure" if levels else None, tuple(counts), curves, fusion, backbone)
    return Model("dmsp-20", FORCE, tuple(Quantity(name, units[name]) for name in names), body)


def fused(model, **changes):
    """The model joined in another way."""
    return replace(model, body=model.body.joined(**changes))


def fit(name, **parameters):
    formula = literature.get(name)
    rng = np.random.default_rng(5)
    values = {one: float(rng.uniform(0.2, 1.1)) for one in formula.parameters} | parameters
    return FormulaFit(
        name, values, dict.fromkeys(values, 0.0), "converged", "by hand", len(values), 1.0, 0.0, 100
    )


def formula(name, **parameters):
    found = fit(name, **parameters)
    inputs = sorted(literature.get(name).inputs)
    limits = {
        one: {"pressure": (0.0, 600.0), "strain": (0.0, 0.25)}.get(one, (-1.0, 1.5))
        for one in inputs
    }
    ranges = (CurveRange("all", None, limits),)
    return Model(
        name, FORCE, tuple(Quantity(one, "1") for one in inputs), Formula(found, None, ranges)
    )


def memory(
    states,
    terms,
    *,
    scaled=True,
    backbone=None,
    gain=0.4,
    theta=(),
):
    rng = np.random.default_rng(3)
    sources = (
        "pressure",
        "pressure[k-2]",
        "slow(pressure, 0.05)",
        "force[k-1]",
        "force[k-2]",
        "rate(strain)",
    )
    ranges = dict.fromkeys(sources, (0.0, 500.0)) | {"strain": (0.0, 0.2)}
    low = np.array([0.0 if "velocity" not in name else -300.0 for name in states])
    high = np.array([0.2 if "strain" in name else 400.0 for name in states])
    empty = np.empty(0)
    found = StateSet(
        states,
        0.01,
        ranges,
        {"pressure": (3.0, 0.2)},
        low if scaled else empty,
        high if scaled else empty,
        0.15,
    )
    weights = np.array(theta) if theta else rng.uniform(-gain, gain, len(terms))
    inner = MemoryModel("force", found, terms, weights, weights, 12.5, (-100.0, 900.0))
    names = sorted(
        {name for name in ("pressure", "strain") if any(name in state for state in states)}
        | set(literature.get(backbone.name).inputs if backbone else ())
    )
    limits = {name: {"pressure": (0.0, 500.0), "strain": (0.0, 0.2)}[name] for name in names}
    units = {"pressure": "kPa", "strain": "1"}
    body = Memory(inner, (CurveRange("a", None, limits),), backbone)
    return Model("with memory", FORCE, tuple(Quantity(name, units[name]) for name in names), body)


def motion(switching, *, directed, dead_band, start="rest"):
    poles = [(-0.81, 1.75), (-0.5, 1.3), (-0.72, 1.6), (-0.3, 1.1)]
    ways = [
        (place, way) for place in (1, 2) for way in (("rise", "fall") if directed else ("all",))
    ]
    sections = tuple(
        MotionSection(f"{way} {place}", place, way, p1, p2, np.array([0.02, 0.3 + i, 0.001]))
        for i, ((place, way), (p1, p2)) in enumerate(zip(ways, poles, strict=False))
    )
    drives = ("pressure", "1", "pressure*strain")
    body = Motion(
        "pressure",
        "angle",
        0.01,
        switching,
        (240.0,),
        directed,
        dead_band,
        drives,
        sections,
        (0.0, 500.0),
        start,
    )
    ranges = (CurveRange("a", None, {"pressure": (0.0, 500.0), "strain": (0.0, 0.2)}),)
    return Model("motion", Quantity("angle", "deg"), (PRESSURE, STRAIN), StateSpace(body, ranges))


SAROSI = fit("sarosi", a1=-0.3, a2=200.0, a3=-8.0, a4=-0.9, a5=0.8, a6=-60.0)
HINGED = {"w": 12.0, "a3": -9.0, "s3": -8.0, "share": 0.7, "a1": 1.0, "a2": 100.0, "b1": 0.01}

STATIC = {
    "steps": pieces(transition="linear", z_s=0.0, sides=("continue", "continue")),
    "quadratic, continued straight": pieces(
        transition="quadratic",
        sides=("continue_linear", "continue_linear"),
        level_sides=("continue_linear", "continue_linear"),
    ),
    "widest zones, zero": pieces(
        transition="linear", z_s=0.5, sides=("zero", "zero"), level_sides=("zero", "zero")
    ),
    "values": pieces(sides=(0.05, "saturate"), level_sides=(150.0, 480.0)),
    "shape between levels": fused(
        pieces(level_sides=("continue_linear", "saturate")), levels="pchip"
    ),
    "straight beyond the levels": pieces(level_sides=("continue_linear", "saturate")),
    "straight on one side": pieces(sides=("saturate", "continue_linear")),
    "zero on one side": pieces(sides=("continue", "zero")),
    "backbone, shrunken": pieces(backbone=SAROSI, shrink=0.3),
    "hinged backbone": pieces(backbone=fit("sarosi_hinged", **HINGED), shrink=0.8),
    "two variables": pieces(
        levels=(100.0, 300.0),
        counts={"speed": 2, "strain": 3},
        terms=("strain*speed", "abs(speed)", "sign(speed)*strain^2", "speed^5", "1/(2 + strain)"),
    ),
    "not held": fused(pieces(sides=("saturate", "continue_linear")), hold="none"),
    "no levels": pieces(levels=None, counts={"strain": 4}),
    "one level": pieces(levels=(200.0,), level_sides=("zero", "continue_linear")),
    "two levels": pieces(levels=(100.0, 300.0)),
    "level in the terms": replace(pieces(), name="level in the terms"),
    "a difference": Model(
        "a difference",
        FORCE,
        (PRESSURE, STRAIN),
        Sum(
            (
                Part(pieces()),
                Part(
                    formula("sarosi", a3=-4.0),
                    -1.0,
                    {"strain": "0.25 - strain", "pressure": "2*pressure"},
                ),
            )
        ),
    ),
}
FORMULAS = {
    name: formula(name, **HINGED if name == "sarosi_hinged" else {"theta": 0.4, "diameter": 0.02})
    for name in literature.names()
    if not name.startswith("sarosi_hysteresis_loss") and literature.get(name).inputs
}
LAGS = ("pressure", "pressure[k-3]", "strain", "strain[k-1]")
OPERATORS = (
    "pressure",
    "slow(pressure, 0.3)",
    "play(pressure, 0.2)",
    "stop(pressure, 0.1)",
    "saturate(strain)",
    "resonance(pressure)",
    "resonance_velocity(pressure, 2, 0.3)",
    "slow(play(pressure, 0.1), 0.05)[k-2]",
    "play(pressure[k-2], 0.15)",
    "stop(slow(pressure, 0.05), 0.2)",
    "wen(pressure, 2, 9)",
    "wen_stiffening(strain, -1.4, 0)",
    "dahl(pressure[k-2], 30)",
    "creep(pressure, 4, 0.05)",
    "coulomb(rate(strain), 0.1)",
    "direction(play(pressure, 0.2))",
)
FED_BACK = ("force[k-1]", "force[k-3]", "pressure", "pressure[k-2]")
WITH_MEMORY = {
    "lags": memory(LAGS, ("pressure", "pressure[k-3]*strain", "strain[k-1]^2")),
    "operators": memory(
        OPERATORS, (*OPERATORS, "slow(pressure, 0.3)*play(pressure, 0.2)", "stop(pressure, 0.1)^3")
    ),
    "unscaled, on a backbone": memory(
        LAGS,
        ("pressure", "strain[k-1]", "pressure*strain"),
        scaled=False,
        backbone=SAROSI,
        gain=0.1,
    ),
    "fed back": memory(
        FED_BACK,
        ("force[k-1]", "force[k-3]*pressure", "pressure", "pressure[k-2]", "force[k-1]^2"),
        gain=90.0,
    ),
    "operators of the output": memory(
        (
            "slow(force[k-1], 0.1)",
            "play(force[k-2], 0.1)[k-1]",
            "stop(force[k-1], 0.05)",
            "pressure",
            "pressure[k-6]",
        ),
        (
            "slow(force[k-1], 0.1)",
            "play(force[k-2], 0.1)[k-1]*pressure",
            "stop(force[k-1], 0.05)",
            "pressure[k-6]",
            "pressure",
        ),
        gain=90.0,
    ),
    "hysteresis of the output": memory(
        ("wen(force[k-1], 0, 7)", "dahl(force[k-1], 3)", "force[k-1]", "pressure"),
        ("wen(force[k-1], 0, 7)", "dahl(force[k-1], 3)*pressure", "force[k-1]", "pressure"),
        gain=90.0,
    ),
    "diverging": memory(FED_BACK, ("force[k-1]", "pressure"), scaled=False, theta=(1.03, 0.01)),
    "motion, hard": motion("hard", directed=True, dead_band=0.0),
    "motion, hard, from zero": motion("hard", directed=True, dead_band=0.0, start="zero"),
    "motion, carried from zero": motion("carried", directed=True, dead_band=0.0, start="zero"),
    "motion, handed on": motion("bumpless", directed=True, dead_band=25.0),
    "motion, whatever the direction": motion("bumpless", directed=False, dead_band=0.0),
    "a sum of two that are fed back": Model(
        "two",
        FORCE,
        (PRESSURE,),
        Sum(
            (
                Part(memory(FED_BACK, ("force[k-1]", "pressure"), gain=60.0)),
                Part(memory(FED_BACK, ("force[k-3]", "pressure"), gain=9.0), -1.0),
            )
        ),
    ),
    "a sum": Model(
        "a sum",
        FORCE,
        (PRESSURE, STRAIN),
        Sum((Part(pieces()), Part(memory(OPERATORS, OPERATORS), -1.0))),
    ),
}
