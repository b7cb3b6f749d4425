"""Write the tables of docs/campaigns.md: `python docs/campaign_tables.py RUNS`.

How often a change is found is tried on simulated pairs of campaigns, whose seeds nobody has looked
at before; that a muscle which did not change is left in peace, on measured repeats. The measured
recordings must be there (docs/data.md).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from pages import DOCS, run, write_page

from datasets.rig.load_cycle import LoadCycles, load_cycle
from datasets.rig.sensors import measure
from datasets.rig.simulate import KPA, SimulationSpec
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Curve, Quantity
from mapmore_cli.modelling.pieces.build import build
from mapmore_cli.modelling.pieces.recipe import Cuts, Recipe
from mapmore_cli.modelling.validation.comparison import CHANGED, SAME, UNCLEAR, Comparison, compare
from mapmore_cli.reporting.table import Cell, Table
from mapmore_cli.study.loader import load_as

FACTORS = (1.00, 1.01, 1.02, 1.03, 1.05)
PAIRS = 20
FIRST_SEED = 7000
EVERY = 10
"""One sample in ten of the simulated cycles: 250 of a curve."""
PRESSURES = {
    4: (80.0, 150.0, 250.0, 350.0),
    8: (80.0, 120.0, 160.0, 200.0, 240.0, 280.0, 320.0, 350.0),
}
QUANTITIES = {
    q.name: q
    for q in (Quantity("pressure", "kPa"), Quantity("strain", "1"), Quantity("force", "N"))
}
RECIPE = Recipe(  # M2 section 5.1
    target="force",
    dictionary=("1", "strain", "strain^2", "strain^3", "strain^4"),
    cuts={"strain": Cuts("even", 4)},
    level="pressure",
)


@cache
def rig() -> SimulationSpec:
    """Return the rig of the load cycles of the simulated McKibben muscle."""
    return load_as(DOCS.parent / "datasets" / "mckibben" / "load_cycles.yaml", SimulationSpec).spec


@cache
def cycle(seed: int, pressure: float) -> tuple[dict[str, np.ndarray], np.random.Generator]:
    """One cycle as it truly is, and the random numbers that its sensors go on with."""
    spec = rig()
    random = np.random.default_rng([seed, round(pressure)])
    assert isinstance(spec.experiment, LoadCycles)
    return dict(
        load_cycle(spec.muscle, spec.hysteresis, spec.experiment, KPA * pressure, random)
    ), random


def simulated(name: str, seed: int, pressures: Sequence[float], factor: float) -> Model:
    """Return a model of a campaign of load cycles, in which the muscle pulls `factor` times as
    strongly.
    """
    seen = {key: rig().sensors[key] for key in ("strain", "force")}
    curves = []
    for pressure in pressures:
        truth, random = cycle(seed, pressure)
        scaled = {**truth, "force": factor * truth["force"]}
        seed_again = random.bit_generator.seed_seq
        logged = measure(scaled, seen, np.random.default_rng(seed_again))  # type: ignore[arg-type]
        columns = {key: logged[key][::EVERY] for key in ("strain", "force")}
        n = len(columns["force"])
        columns["pressure"] = np.full(n, pressure)
        curves.append(
            Curve(f"pressure={pressure:g}", pressure, columns, np.zeros(n, dtype=bool), ("cycle",))
        )
    return build(name, curves, RECIPE, QUANTITIES)


def pairs(count: int, factor: float, number: int = PAIRS) -> Iterator[Comparison]:
    """Comparisons of simulated campaigns of so many curves, the first `number` of them."""
    for pair in range(number):
        seed = FIRST_SEED + 100 * count + 2 * pair
        yield compare(
            simulated("before", seed, PRESSURES[count], 1.0),
            simulated("after", seed + 1, PRESSURES[count], factor),
        )


def detection(_runs: Path) -> Table:
    """How often a change is found."""
    rows: list[tuple[Cell, ...]] = []
    for count in PRESSURES:
        for factor in FACTORS:
            found = list(pairs(count, factor))
            widths = [one.interval[1] - one.interval[0] for one in found]
            certain = sum(one.interval[0] > 1 or one.interval[1] < 1 for one in found)
            ratios = [one.ratio for one in found]
            answers = [one.answer for one in found]
            called = [f"{answers.count(answer)} of {PAIRS}" for answer in (CHANGED, SAME, UNCLEAR)]
            rows.append(
                (
                    count,
                    factor,
                    *called,
                    certain,
                    min(ratios),
                    max(ratios),
                    float(np.median(widths)),
                )
            )
    columns = (
        "curves",
        "force, true factor .2f",
        "called changed",
        "called the same",
        "cannot tell",
        "interval excludes 1",
        "least ratio .4f",
        "largest ratio .4f",
        "median width of the interval .4f",
    )
    return Table.of("detection", f"{PAIRS} simulated pairs each", columns, rows)


def first_pairs(_runs: Path) -> Table:
    """Return the first pairs one by one, which a test repeats."""
    rows = ((number, one.ratio, *one.interval) for number, one in enumerate(pairs(4, 1.03, 3), 1))
    columns = ("pair", "ratio .5f", "from .5f", "to .5f")
    return Table.of(
        "first",
        "The first pairs with four curves and a force that is 1.03 times as large",
        columns,
        rows,
    )


def festo(length: int, repeats: str, runs: Path) -> Model:
    """Return a model of the Festo muscle of so many cm, trained on some of its repeats (`89`: 8 and
    9).
    """
    numbers = {"8": ["8"], "9": ["9"], "10": ["10"], "89": ["8", "9"]}[repeats]
    others = [f"*_Test{number}.csv.gz" for number in ("8", "9", "10") if number not in numbers]
    name = f"festo_10mm_{length}cm_test{repeats}"
    settings = (
        f"name={name}",
        "data.split=" + f"{{validate: {{files: {others}}}}}".replace("'", '"'),
    )
    return replace(
        run(f"festo/festo_10mm_{length}cm_repeat", runs, *settings, until="fuse").model(), name=name
    )


def measured(runs: Path) -> Table:
    """Repeats of one muscle, and muscles of different lengths."""
    repeats = [
        ((length, first), (length, "10")) for length in (10, 20, 30) for first in ("8", "9", "89")
    ]
    lengths = [((20, one), (30, one)) for one in ("8", "10", "89")]
    rows: list[tuple[Cell, ...]] = []
    for before, after in (*repeats, *lengths):
        found = compare(festo(*before, runs), festo(*after, runs))
        heaviest = max(curve.weight for curve in found.curves)
        names = [
            f"{length} cm, repeat{'s 8 and 9' if which == '89' else ' ' + which}"
            for length, which in (before, after)
        ]
        rows.append(
            (
                *names,
                found.ratio,
                *found.interval,
                found.p,
                len(found.curves),
                100 * heaviest,
                found.answer,
            )
        )
    columns = (
        "before",
        "after",
        "ratio .4f",
        "from .4f",
        "to .4f",
        "p .2g",
        "curves",
        "weight of the heaviest curve [%] .0f",
        "answer",
    )
    return Table.of("festo", "Measured Festo muscles", columns, rows)


if __name__ == "__main__":
    write_page("campaigns.md", {"detection": detection, "first": first_pairs, "festo": measured})
