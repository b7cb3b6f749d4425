"""H's figures 3 to 6 with the simulated muscles, one journal column wide: `python
docs/muscle_figures.py RUNS [FOLDER]`.

SVG with the numbers as CSV go to docs/figures, PDF to FOLDER where one is named.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from muscle_tables import joint_forces
from pages import DOCS, asked, printed, run

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling import literature

FIGURES = DOCS / "figures"
EVERY = 10
"""One sample in so many is drawn as a dot."""
ZOOM = (10.0, 11.0)
"""s, of the record that began at 400 kPa: held out, as blocks of 8 s are."""
COLUMN = 88 / 25.4
"""Inches, one column of a journal page."""
LAST = 2.0
"""s of the joint's records that are drawn, from their end."""
CAPTIONS = {
    "identification": (
        "The 16 cm muscle at closed valves, five initial pressures: force over elongation "
        "(one sample in ten), and one held-out second "
        "of the record from 400 kPa, measured (black) and by the muscle-like model."
    ),
    "curves": (
        "Force over length and over velocity, each over its greatest value: a biological "
        "muscle, H's and a simulated pneumatic one."
    ),
    "joint-closed": (
        "Forces of both muscles while a motor swings the joint, valves closed: measured "
        "(black), and by models identified before."
    ),
    "joint-driven": (
        "Forces of both muscles while their valves drive the joint, measured (black) and by "
        "the same models."
    ),
}
Line = tuple[str, str, Array, Array]
"""Panel, line, places, values."""

# Biological muscle
# --------------------------------------------------------------------------------------------------

BIOLOGICAL = {"F_max": 1.0, "l_opt": 1.0, "w": 0.56, "v_max": 12.0, "kappa": 5.0, "N": 1.5}
"""Of H's eq 1-3 at full activation, lengths as shares of the optimal one: Geyer, Seyfarth and
Blickhan 2003, table 1; H does not print its own.
"""


def biological(share: Array | float, v: Array | float) -> Array:
    """H eq 1-3 over lengths and velocities in optimal lengths (per second), shortening positive."""
    share, v = np.broadcast_arrays(share, v)
    columns = {"pressure": np.ones_like(v), "length": share, "velocity": v}
    return literature.get("hill").predict(BIOLOGICAL, columns)


def curves(runs: Path) -> Iterator[Line]:
    """Normalised forces of H's figure 4, for H's printed and our simulated 16 cm muscle."""
    fit = run("muscle-like/muscle-like-16cm", runs).validation().formulas["muscle_like"].parameters
    said = {
        name: float(v)
        for name, v in next(r for r in printed("h_table_1.csv") if r["muscle"] == "16 cm").items()
        if name in fit
    }
    share = np.linspace(0.0, 1.0, 101)
    longest, fastest = 0.03, 0.2
    yield "length", "biological", share, biological(share, 0.0)
    for label, p in (("H, 16 cm", said), ("simulated, 16 cm", dict(fit))):
        x = longest * share
        active = 1 + p["a0"] * x + p["a1"] * x**2 + p["a2"] * x**3
        yield "length", label, share, active / active.max()
    v = np.linspace(-1.0, 1.0, 201)
    force = biological(1.0, -v * BIOLOGICAL["v_max"])
    yield "velocity", "biological", v, force / force.max()
    for label, p in (("H, 16 cm", said), ("simulated, 16 cm", dict(fit))):
        force = 1 - p["b0"] * fastest * v  # H's velocity is positive in shortening
        yield "velocity", label, v, force / force.max()


# Lines
# --------------------------------------------------------------------------------------------------


def identification(runs: Path) -> Iterator[Line]:
    """H's figure 3: force over elongation at every initial pressure, and a second of it beside the
    model.
    """
    files = run("muscle-like/muscle-like-16cm", runs)
    for curve, force in zip(
        files.dataset().curves, files.validation().predictions["muscle_like"], strict=True
    ):
        columns = curve.columns
        initial = f"{columns['initial'][0]:g} kPa"
        yield "elongation", initial, 1e3 * columns["length"][::EVERY], columns["force"][::EVERY]
        if initial == "400 kPa":
            shown = (columns["time"] >= ZOOM[0]) & (columns["time"] <= ZOOM[1])
            assert curve.held_out[shown].all()
            yield "time", "measured", columns["time"][shown], columns["force"][shown]
            yield "time", "muscle_like", columns["time"][shown], force[shown]


def joint(runs: Path, experiment: str) -> Iterator[Line]:
    """H's figures 5 and 6: the forces of both muscles over the last seconds of a record."""
    for muscle, time, measured, predicted in joint_forces(runs, experiment):
        shown = time > time[-1] - LAST
        yield muscle, "measured", time[shown], measured[shown]
        yield muscle, "muscle_like", time[shown], predicted[shown]


LINES: Mapping[str, Callable[[Path], Iterator[Line]]] = {
    "identification": identification,
    "curves": curves,
    "joint-closed": lambda runs: joint(runs, "closed"),
    "joint-driven": lambda runs: joint(runs, "driven"),
}
LABELS = {
    "elongation": ("Elongation (mm)", "Force (N)"),
    "time": ("Time (s)", "Force (N)"),
    "length": ("Length / longest", "Force / greatest"),
    "velocity": ("Velocity / fastest", "Force / greatest"),
    "extensor": ("Time (s)", "Extensor (N)"),
    "flexor": ("Time (s)", "Flexor (N)"),
}

# Drawing
# --------------------------------------------------------------------------------------------------


def figure(lines: Sequence[Line]) -> Any:
    """Return the panels below each other, in one column of a journal page."""
    from matplotlib.figure import Figure

    from mapmore_cli.reporting.figures.style import BLACK, OWN_STYLE, level_colours

    panels = list(dict.fromkeys(panel for panel, *_ in lines))
    drawn = Figure(figsize=(COLUMN, 0.4 + 1.9 * len(panels)), layout="constrained")
    axes = dict(zip(panels, np.atleast_1d(drawn.subplots(len(panels), 1)), strict=True))
    pressures = [line for panel, line, *_ in lines if panel == "elongation"]
    colours = dict(zip(pressures, level_colours(len(pressures)), strict=False)) | {
        "measured": BLACK,
        "biological": BLACK,
        "muscle_like": OWN_STYLE.colour,
    }
    for panel, line, x, y in lines:
        dots = panel == "elongation"
        look: dict[str, Any] = (
            {"linestyle": "none", "marker": ".", "markersize": 1.5}
            if dots
            else {"linestyle": "-" if line in colours else "--"}
        )
        axes[panel].plot(x, y, label=line, color=colours.get(line), **look)
    for panel, ax in axes.items():
        ax.set_xlabel(LABELS[panel][0])
        ax.set_ylabel(LABELS[panel][1])
        if panel in ("length", "velocity"):
            ax.set_ylim(0, 1.05)
    handles, names = axes[panels[0]].get_legend_handles_labels()
    if panels[0] == "elongation":
        later = axes[panels[1]].get_legend_handles_labels()
        handles, names = handles + later[0], names + later[1]
    drawn.legend(
        handles, names, loc="outside upper left", ncols=3 if len(handles) > 2 else 2, markerscale=4
    )
    return drawn


def drawn(runs: Path, names: Sequence[str] = tuple(LINES)) -> dict[str, str]:
    """Return the figures as `<svg>` elements."""
    from mapmore_cli.reporting.figures.drawing import to_svg
    from mapmore_cli.reporting.figures.style import figure_style

    with figure_style():
        return {
            name: to_svg(figure(list(LINES[name](runs))), f"muscle-like-{name}", CAPTIONS[name])
            for name in names
        }


def write(runs: Path, folder: Path | None = None) -> None:
    """Every figure with its numbers; as PDF too where a folder is named."""
    from mapmore_cli.reporting.figures.drawing import SVG_PROLOGUE, to_bytes
    from mapmore_cli.reporting.figures.style import figure_style

    for name, svg in drawn(runs).items():
        lines = list(LINES[name](runs))
        (FIGURES / f"muscle-like-{name}.svg").write_text(
            SVG_PROLOGUE + svg, encoding="utf-8", newline="\n"
        )
        rows = [
            f"{panel},{line.replace(', ', ' ')},{a:.12g},{b:.12g}"
            for panel, line, x, y in lines
            for a, b in zip(x, y, strict=True)
        ]
        text = "\n".join(["panel,line,place,force", *rows]) + "\n"
        (FIGURES / f"muscle-like-{name}.csv").write_text(text, encoding="utf-8", newline="\n")
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
            with figure_style():
                (folder / f"muscle-like-{name}.pdf").write_bytes(
                    to_bytes(figure(lines), "pdf", name, CAPTIONS[name])
                )


if __name__ == "__main__":
    runs, folder = asked()
    write(runs, Path(folder[0]) if folder else None)
