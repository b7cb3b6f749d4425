"""Write the tables of docs/planning.md: `python docs/planning_tables.py RUNS`.

The measured recordings must be there (docs/data.md). It takes some minutes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from pages import CONFIGS, DOCS, asked, write_tables

from mapmore_cli.annexes.planning.of_points import formulas_of
from mapmore_cli.annexes.planning.points import Committee, MeasuredMap
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.fitting.kinds import refit
from mapmore_cli.fitting.kinds.choices import ModelChoices, model_choices
from mapmore_cli.fitting.left_out import residuals
from mapmore_cli.modelling.forecast import forecast
from mapmore_cli.modelling.literature.backbone import pooled_training
from mapmore_cli.modelling.validation.intervals import ASTRAY, INTERVAL, half_widths
from mapmore_cli.pipeline.runner import bring_up_to_date
from mapmore_cli.reporting.table import Cell, Table
from mapmore_cli.storage.artefacts import read_dataset
from mapmore_cli.study.loader import load

DRAWS = 9
"""Random orders, of which the median counts."""

OVER_STRAIN = (
    "model={type: mapmore}",
    "segment={strain: none}",
    "dictionary=[{polynomial: {of: [strain], order: 3}}]",
    "fit={max_terms: 3}",
)
FESTO = (
    *OVER_STRAIN[:2],
    "dictionary=[{polynomial: {of: [strain], order: 2}}]",
    "fit={max_terms: 3}",
    "data.levels={of: pressure, at: [100, 140, 180, 220, 260, 300, 350, 400, 450, 500, 550, "
    "600], within: 4}",
)
LEVELS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "pgm, pressures": ("pgm/pgm_force", OVER_STRAIN),
    "datasheet, pressures": ("festo/festo_datasheet", OVER_STRAIN),
    "bellows, strains": ("bellows/bellows_strain", ("model={type: mapmore}",)),
    **{
        f"Festo {cm} cm, pressures": (f"festo/festo_10mm_{cm}cm_strain", FESTO)
        for cm in (10, 20, 30)
    },
}
"""Studies with their overrides: the levels of one quantity."""

WANTED = (0.03, 0.05, 0.08, 0.12)
"""Half widths at which a campaign stops, as parts of the largest |target|."""


@dataclass(frozen=True)
class Campaign:
    """Levels in the order of their measuring, with the error of the model of the first k, k from
    `START` on, as parts of the largest.
    """

    order: tuple[float, ...]
    errors: Array


START = 3


@cache
def study(name: str, runs: Path) -> tuple[ModelChoices, Dataset]:
    """Return a study whose samples all train."""
    config, overrides = LEVELS[name]
    loaded = load(
        CONFIGS / f"{config}.yaml",
        (f"name=plan-{name.split(',')[0].replace(' ', '-')}", "data.split={}", *overrides),
    )
    return model_choices(loaded.spec), read_dataset(
        bring_up_to_date(loaded, runs, "ingest").run_dir / "ingest.h5"
    )


def trained_on(dataset: Dataset, at: Sequence[float]) -> Dataset:
    """Return the dataset with only these levels for training."""
    return replace(
        dataset,
        curves=tuple(
            replace(c, held_out=np.full(c.size, c.level not in at)) for c in dataset.curves
        ),
    )


def error_of(choices: ModelChoices, dataset: Dataset, at: Sequence[float]) -> float:
    """RMS over all levels of the error of a model of some, each level counting alike, as a part of
    the largest |target|.
    """
    return float(np.sqrt(np.mean([np.mean(e**2) for e in misses(choices, dataset, at)])))


def misses(choices: ModelChoices, dataset: Dataset, at: Sequence[float]) -> list[Array]:
    """Errors at every level of a model of some, as parts of the largest |target|."""
    model = refit(choices, trained_on(dataset, at))
    largest = max(float(np.abs(c.columns[dataset.target]).max()) for c in dataset.curves)
    return [
        (forecast(model, c).values - c.columns[dataset.target]) / largest for c in dataset.curves
    ]


def campaign(
    choices: ModelChoices, dataset: Dataset, choose: Callable[[list[float], list[float]], float]
) -> Campaign:
    """Measure level after level, from the outer ones and the one nearest their middle on."""
    every = sorted({c.level for c in dataset.curves if c.level is not None})
    order = [every[0], every[-1], nearest(every[1:-1], (every[0] + every[-1]) / 2)]
    errors = [error_of(choices, dataset, order)]
    while len(order) < min(len(every) - 1, 9):
        order.append(choose(sorted(order), [v for v in every if v not in order]))
        errors.append(error_of(choices, dataset, order))
    return Campaign(tuple(order), np.array(errors))


def nearest(values: Sequence[float], to: float) -> float:
    """Return the value nearest to another."""
    return min(values, key=lambda value: abs(value - to))


def in_gap(known: Sequence[float], rest: Sequence[float], worth: Array) -> float:
    """Return the level that is nearest the middle of the gap of greatest worth that has one."""
    for gap in np.argsort(-worth, kind="stable"):
        within = [value for value in rest if known[gap] < value < known[gap + 1]]
        if within:
            return nearest(within, (known[gap] + known[gap + 1]) / 2)
    raise AssertionError


def quiet(_what: str, _done: int, _of: int) -> None:
    """No progress."""


@cache
def of_levels_by(name: str, runs: Path) -> Mapping[str, Campaign]:
    """Return the campaigns of one study, by the way in which levels are chosen; of random ones the
    medians.
    """
    choices, dataset = study(name, runs)

    def best(known: list[float], rest: list[float]) -> float:
        return min(rest, key=lambda value: error_of(choices, dataset, [*known, value]))

    drawn = []
    for seed in range(DRAWS):
        rng = np.random.default_rng(seed)
        random = lambda _known, rest, rng=rng: float(rng.choice(rest))  # noqa: E731
        drawn.append(campaign(choices, dataset, random))
    return {
        "equal": campaign(
            choices, dataset, lambda known, rest: in_gap(known, rest, np.diff(known))
        ),
        "random": Campaign((), np.median([one.errors for one in drawn], axis=0)),
        "oracle": campaign(choices, dataset, best),
    }


def levels_table(runs: Path) -> Table:
    """Errors over the number of levels."""
    rows: list[tuple[Cell, ...]] = []
    for name in LEVELS:
        found = of_levels_by(name, runs)
        counts = range(START + 1, START + len(found["equal"].errors))
        rows += [
            (name, k, *(100 * float(one.errors[k - START]) for one in found.values()))
            for k in counts
        ]
    ratio = np.array([row[3:] for row in rows], dtype=float) / np.array(
        [[row[2]] for row in rows], dtype=float
    )
    mean = np.exp(np.log(ratio).mean(axis=0))
    columns = ("map", "levels", *(f"{one} [%] .2f" for one in ("equal", "random", "oracle")))
    note = (
        f"Geometric mean of the ratio to equal distances: random {mean[0]:.2f}, oracle "
        f"{mean[1]:.2f}."
    )
    return Table.of(
        "levels",
        "RMS error over all levels in % of the largest force, by number of measured levels",
        columns,
        rows,
        note,
    )


def stopping_table(runs: Path) -> Table:
    """How often a campaign by equal distances that stops by its half width had reached what was
    wanted.
    """
    rows: list[tuple[Cell, ...]] = []
    for wanted in WANTED:
        stopped = reached = 0
        for name in LEVELS:
            choices, dataset = study(name, runs)
            order = of_levels_by(name, runs)["equal"].order
            for k in range(START, len(order) + 1):
                known = sorted(order[:k])
                data = trained_on(dataset, known)
                left_out = replace(
                    residuals(choices, data, {}, quiet, refit(choices, data)), repeats=(1,) * k
                )
                if left_out.astray > ASTRAY:
                    continue
                middles = (np.array(known[1:]) + np.array(known[:-1])) / 2
                if half_widths(left_out, middles, INTERVAL).max() <= wanted * left_out.largest:
                    stopped += 1
                    errors = np.abs(np.concatenate(misses(choices, dataset, known)))
                    reached += bool(np.quantile(errors, INTERVAL) <= wanted)
                    break
        rows.append((100 * wanted, len(LEVELS), stopped, reached))
    columns = ("wanted [%] .0f", "campaigns", "stopped", "reached")
    return Table.of(
        "stopping",
        "Campaigns that stop when the largest half width is as small as wanted",
        columns,
        rows,
    )


# Maps
# --------------------------------------------------------------------------------------------------

POOL, SIZES, STARTS, KNOWN = 60, (8, 10, 12, 18), 6, 12
"""Points of a map that can be measured, how many are, from how many starts, and of how many the
oracle knows what they are worth.
"""


@cache
def pool_of(name: str, runs: Path) -> MeasuredMap:
    """Return some points of a study, spread over it."""
    from mapmore_cli.annexes.planning.points import spread_out

    choices, dataset = study(name, runs)
    del choices
    columns = pooled_training(dataset.curves)
    x, y = spread_out(np.column_stack([columns["pressure"], columns["strain"]]), columns["force"])
    return MeasuredMap(("pressure", "strain"), x[:POOL], y[:POOL])


def committee_of(name: str, runs: Path, taken: Sequence[int]) -> Committee:
    """Return the committee of some points of a map."""
    pool, dataset = pool_of(name, runs), study(name, runs)[1]
    own = MeasuredMap(pool.names, pool.x[list(taken)], pool.y[list(taken)])
    curve = replace(
        dataset.curves[0],
        level=None,
        columns={"pressure": own.x[:, 0], "strain": own.x[:, 1], "force": own.y},
        held_out=np.zeros(len(own.y), dtype=bool),
        at_rest=None,
        origin=None,
    )
    return Committee(own, pool.x, formulas_of(replace(dataset, curves=(curve,)), own, pool.x))


def map_error(committee: Committee, pool: MeasuredMap) -> float:
    """RMS error of the committee over all points of the map, as a part of the largest force."""
    return float(np.sqrt(np.mean((committee.expected - pool.y) ** 2)) / np.abs(pool.y).max())


def start_of(pool: MeasuredMap, seed: int) -> list[int]:
    """Five points: the corners and the middle, or by chance."""
    if seed:
        return [
            int(one) for one in np.random.default_rng(seed).choice(len(pool.y), 5, replace=False)
        ]
    spots = [(0, 0), (1, 0), (0, 1), (1, 1), (0.5, 0.5)]
    return list(
        dict.fromkeys(
            int(np.argmin(np.sum((pool.scaled(pool.x) - spot) ** 2, axis=1))) for spot in spots
        )
    )


def points_by(name: str, runs: Path, way: str, seed: int = 0) -> dict[int, float]:
    """Errors by the number of points, from one start on."""
    pool, rng = pool_of(name, runs), np.random.default_rng([seed, 1])
    scaled, taken = pool.scaled(pool.x), start_of(pool, seed)
    found: dict[int, float] = {}
    while len(taken) <= max(SIZES):
        if len(taken) in SIZES:
            found[len(taken)] = map_error(committee_of(name, runs, taken), pool)
        rest = np.setdiff1d(np.arange(len(pool.y)), taken)
        if way == "plan":
            worth = committee_of(name, runs, taken).score[rest]
        elif way == "equal":
            worth = np.min(
                np.sum((scaled[rest][:, None] - scaled[taken][None]) ** 2, axis=2), axis=1
            )
        else:
            rest = rng.choice(rest, 1 if way == "random" else min(KNOWN, len(rest)), replace=False)
            worth = np.array(
                [
                    0.0
                    if way == "random"
                    else -map_error(committee_of(name, runs, [*taken, one]), pool)
                    for one in rest
                ]
            )
        taken.append(int(rest[np.argmax(worth)]))
    return found


WAYS = ("plan", "equal", "random", "oracle")


@cache
def map_errors(runs: Path) -> Array:
    """Return the errors of all maps, starts, numbers of points and ways, shape (m, s, n, w)."""
    return np.array(
        [
            [
                [[errors[size] for errors in ways] for size in SIZES]
                for seed in range(STARTS)
                for ways in [[points_by(name, runs, way, seed) for way in WAYS]]
            ]
            for name in LEVELS
        ]
    )


def maps_table(runs: Path) -> Table:
    """Errors over the number of points, medians over the starts."""
    rows: list[tuple[Cell, ...]] = [
        (name.split(",")[0], size, *map(float, row))
        for name, errors in zip(LEVELS, 100 * np.median(map_errors(runs), axis=1), strict=True)
        for size, row in zip(SIZES, errors, strict=True)
    ]
    columns = ("map", "points", *(f"{one} [%] .2f" for one in WAYS))
    caption = "RMS error over the map in % of the largest force, by number of measured points"
    return Table.of("maps", caption, columns, rows)


def ratios_table(runs: Path) -> Table:
    """Errors in the mean over the maps, divided by those of equal distances."""
    errors = map_errors(runs)
    equal = WAYS.index("equal")
    logs = np.median(np.log(errors / errors[..., equal : equal + 1]), axis=1)
    means = np.delete(np.exp(logs.mean(axis=0)), equal, axis=1)
    rows: list[tuple[Cell, ...]] = [
        (size, *map(float, row)) for size, row in zip(SIZES, means, strict=True)
    ]
    columns = ("points", *(f"{way} .2f" for way in WAYS if way != "equal"))
    caption = (
        "Error divided by that of equal distances: median over the starts, geometric mean over "
        "the maps"
    )
    return Table.of("ratios", caption, columns, rows)


def tables(runs: Path) -> Mapping[str, Callable[[], Table]]:
    """Every table of the page."""
    return {
        "levels": lambda: levels_table(runs),
        "stopping": lambda: stopping_table(runs),
        "maps": lambda: maps_table(runs),
        "ratios": lambda: ratios_table(runs),
    }


if __name__ == "__main__":
    write_tables(DOCS / "planning.md", tables(asked()[0]))
