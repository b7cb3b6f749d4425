"""Curves of an imagined muscle for the tests of the method."""

from dataclasses import fields, replace

import numpy as np

from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.modelling.pieces.build import build
from mapmore_cli.modelling.pieces.recipe import BelowAbove, Cuts, Fuse, Recipe
from mapmore_cli.modelling.selection import Fit

QUANTITIES = {
    "pressure": Quantity("pressure", "kPa"),
    "strain": Quantity("strain", "1"),
    "force": Quantity("force", "N"),
}
POWERS = ("1", "strain", "strain^2", "strain^3", "strain^4")


def force(pressure, strain):
    """Neither polynomial nor Sarosi's form."""
    return (
        3 * pressure * (1 - 3.5 * strain) ** 2
        - 40 * np.sqrt(1 + (strain / 0.05) ** 2)
        + 60 / (1 + strain / 0.02)
    )


def curves(levels=(80.0, 150.0, 250.0, 350.0), held_out=(250.0,), n=120, noise=1.0, seed=0):
    """Isobaric curves over a strain range that grows with pressure."""
    rng = np.random.default_rng(seed)
    made = []
    for level in levels:
        strain = np.linspace(0, 0.05 + 0.0005 * level, n)
        columns = {
            "pressure": level + rng.normal(0, 0.2, n),
            "strain": strain,
            "force": force(level, strain) + rng.normal(0, noise, n),
        }
        made.append(
            Curve(
                f"pressure={level:g}",
                level,
                columns,
                np.full(n, level in held_out),
                (f"load_cycle_{level:g}",),
            )
        )
    return tuple(made)


def recipe(**changes):
    """M2's default configuration, with changes by the name of the setting."""
    asked = {
        "target": "force",
        "level": "pressure",
        "cuts": {"strain": Cuts("even", 4)},
        "dictionary": POWERS,
    } | changes

    def told(of, **own):
        return of(
            **{one.name: asked.pop(one.name) for one in fields(of) if one.name in asked}, **own
        )

    if isinstance(sides := asked.get("extrapolation"), dict):
        asked["extrapolation"] = {name: BelowAbove(*ends) for name, ends in sides.items()}
    made = told(Recipe, fit=told(Fit), fuse=told(Fuse))
    assert not asked, f"unknown settings {list(asked)}"
    return made


def built(samples=None, backbone=None, **changes):
    """The model of the curves, or of some samples."""
    return build("imagined", samples or curves(), recipe(**changes), QUANTITIES, backbone)


def joined(model, **changes):
    """The model with its pieces fused in another way."""
    fusion = replace(model.body.fusion, **changes)
    return replace(model, body=replace(model.body, fusion=fusion))


def changed(curve, **columns):
    """The curve with other columns."""
    return replace(curve, columns={**curve.columns, **columns})


def at(pressure, strain):
    """Columns of the inputs."""
    pressure, strain = np.broadcast_arrays(np.asarray(pressure, float), np.asarray(strain, float))
    return {"pressure": pressure.ravel().copy(), "strain": strain.ravel().copy()}
