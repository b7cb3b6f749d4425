"""Write the table and the figure of docs/control.md: `python docs/control_tables.py RUNS`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import yaml
from closed_loop import Lift, Loop, closed_loop, wanted_force
from pages import DOCS, asked, rms, run, write_page

from datasets.rig.simulate import KPA, SimulationSpec
from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.models import Model
from mapmore_cli.modelling.inverse import NEAREST, invert
from mapmore_cli.reporting.table import Cell, Table

LIFT = Lift(mass=20.0, length=0.088, damping=400.0, lag=0.05, highest=350 * KPA, step=0.5e-3)
LOOP = Loop(period=5e-3, kp=500 * KPA, ki=4000 * KPA)
SECONDS, SETTLED = 8.0, 2.0
"""How long the course is, and what is left out of the errors at its beginning."""

STUDY = "m2/dmsp-20-88-static"
FEEDS: Mapping[str, tuple[str, ...] | None] = {
    "mapmore": (),
    "mapmore on sarosi": ("name=dmsp-20-88-static.on_sarosi", "model={backbone: sarosi}"),
    "sarosi": ("name=dmsp-20-88-static.sarosi", "model={type: literature, name: sarosi}"),
    "nothing": None,
}
"""Models whose inverse is fed forward: all trained on 80, 150 and 350 kPa."""


def course(seconds: float) -> Array:
    """Strain to follow: two sines of 0.3 and 0.8 Hz about 0.08, which grow over the first
    second.
    """
    time = np.arange(0.0, seconds, LOOP.period)
    growing = np.clip(time, 0.0, 1.0) ** 2 * (3 - 2 * np.clip(time, 0.0, 1.0))
    return np.asarray(
        0.08
        + growing * (0.03 * np.sin(2 * np.pi * 0.3 * time) + 0.01 * np.sin(2 * np.pi * 0.8 * time))
    )


def model_of(settings: tuple[str, ...], runs: Path) -> Model:
    """Return the static model of the study, with other settings."""
    return run(STUDY, runs, *settings, "validate.against=[]", until="fuse").model()


def followed(feed: str, runs: Path, seconds: float, loop: Loop = LOOP) -> Columns:
    """Return what the loop does with a pressure fed forward by the inverse of a model, or with that
    of the first sample alone.
    """
    given = yaml.safe_load(
        (DOCS.parent / "datasets" / "mckibben" / "load_cycles.yaml").read_text(encoding="utf-8")
    )
    spec = SimulationSpec.model_validate(given)
    reference, settings = course(seconds), FEEDS[feed]
    force = wanted_force(LIFT, reference, LOOP.period)
    found = invert(
        model_of(settings or (), runs), force, {"strain": reference}, "pressure", NEAREST
    ).picked
    if not np.isfinite(found).all():
        raise ValueError(
            f"{feed}: there is no pressure for {int(np.sum(~np.isfinite(found)))} of "
            f"{len(found)} samples of the course"
        )
    fed = KPA * (found if settings is not None else np.full(len(found), found[0]))
    return closed_loop(spec.muscle, spec.hysteresis, LIFT, loop, reference, fed)


def errors(
    feed: str, runs: Path, seconds: float = SECONDS, loop: Loop = LOOP
) -> tuple[float, float]:
    """RMSE and largest error of the strain, in % strain, after the beginning."""
    error = (
        100
        * (followed(feed, runs, seconds, loop)["strain"] - course(seconds))[
            round(SETTLED / LOOP.period) :
        ]
    )
    return rms(error), float(np.max(np.abs(error)))


def tracking(runs: Path) -> Table:
    """Tracking errors with the loop closed, and of what is fed forward alone."""
    rows: list[tuple[Cell, ...]] = []
    for feed, settings in FEEDS.items():
        alone = (
            (None, None)
            if settings is None
            else errors(feed, runs, loop=Loop(LOOP.period, 0.0, 0.0))
        )
        rows.append((feed, *errors(feed, runs), *alone))
    heads = ("RMSE", "largest error", "RMSE without the loop", "largest error without the loop")
    columns = ("feedforward by", *(f"{head} [% strain] .3g" for head in heads))
    return Table.of(
        "tracking", "Errors of the strain while a weight of 20 kg follows a course", columns, rows
    )


def figure(runs: Path, path: Path) -> None:
    """Strain and error over time for every loop."""
    from matplotlib.figure import Figure

    from mapmore_cli.reporting.figures.style import figure_style, model_styles

    reference = course(SECONDS)
    time = LOOP.period * np.arange(len(reference))
    with figure_style():
        drawn = Figure(figsize=(7.0, 3.4), layout="constrained")
        top, bottom = drawn.subplots(2, 1, sharex=True)
        for feed, style in model_styles(list(FEEDS)).items():
            strain = followed(feed, runs, SECONDS)["strain"]
            look = {
                "color": style.colour,
                "linestyle": style.dashes,
                "linewidth": 1.0,
                "label": feed,
            }
            top.plot(time, 100 * strain, **look)
            bottom.plot(time, 100 * (strain - reference), **look)
        top.plot(time, 100 * reference, color="black", linewidth=0.8, label="course")
        top.set_ylabel("Strain (%)")
        bottom.set_ylabel("Error (%)")
        bottom.set_xlabel("Time (s)")
        drawn.legend(*top.get_legend_handles_labels(), loc="outside upper left", ncols=5)
        drawn.savefig(path, metadata={"Date": None})


if __name__ == "__main__":
    write_page("control.md", {"tracking": tracking})
    figure(asked()[0], DOCS / "figures" / "closed-loop.svg")
