"""Measure the search on splits that a seed draws: `python docs/search_draws.py RUNS SEED
[STUDY ...]`.

Twelve splits of tables hold out inner levels, an outer level or bands of an input; eight of
recordings hold out the end, bands of time or whole recordings. A row of
docs/tables/search/drawn.csv belongs to a seed, a revision of the search (`revision` in `stage.py`)
and a study; it replaces the earlier row of these. Other models are fitted once for each split: a
second revision takes their errors from the rows of the first. STUDY names the studies whose rows
are made; each row is written as soon as it is made, and so is the summary of all rows.

The measured recordings must be there (docs/data.md), and scikit-learn (extra `baselines`).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pages import DOCS, asked, read_rows, run, scores, shipped, write_tables
from search_tables import BARE, LATEST, NEAR, SETS, SLACK, WORSE, alerts_without_rivals, says_so

from mapmore_cli.annexes.search.black_boxes import BLACK_BOX
from mapmore_cli.annexes.search.samples import searchable
from mapmore_cli.annexes.search.situation import situation_of
from mapmore_cli.annexes.search.stage import STAGE, search_slice
from mapmore_cli.annexes.search.trying import choices_of
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.domain.scores import OWN
from mapmore_cli.fitting.kinds import refit
from mapmore_cli.modelling.forecast import forecast
from mapmore_cli.reporting.table import Cell, Table
from mapmore_cli.storage.run_folder import RunFiles

PAGE = DOCS / "search.md"
TABLES = tuple(LATEST)
RECORDINGS = tuple(name for name in SETS if name not in LATEST)
OF_TABLES = ("inner level", "outer level", "band")
OF_RECORDINGS = ("another recording", "last part", "band")
DRAWN_TABLES, DRAWN_RECORDINGS = 12, 8
MOST_DRAWS = 1000
"""Times that bands are drawn until each holds a sample, which those of few values may not."""
LEAST_LOG = 50
"""Samples of a recording that may be held out as a whole."""


class Draw(NamedTuple):
    """A split of a study that was drawn: `table` or `recording`, and what it holds out."""

    study: str
    data: str
    kind: str
    split: str


def drawn(seed: int, runs: Path) -> list[Draw]:
    """Return the splits that a seed draws: every study at most once, and of what its data can
    hold out the kind that was drawn least so far.
    """
    rng = np.random.default_rng(seed)
    found = list[Draw]()
    for data, names, kinds, count in (
        ("table", TABLES, OF_TABLES, DRAWN_TABLES),
        ("recording", RECORDINGS, OF_RECORDINGS, DRAWN_RECORDINGS),
    ):
        turns = dict.fromkeys(kinds, 0)
        for name in rng.permutation(names)[:count].tolist():
            whole = run(SETS[name].study, runs, *_overrides(name, ""), until="ingest").dataset()
            kind = min((each for each in kinds if _has(each, whole)), key=turns.__getitem__)
            turns[kind] += 1
            found.append(Draw(name, data, kind, _split(name, kind, data, whole, rng)))
    return found


def _has(kind: str, whole: Dataset) -> bool:
    if kind.endswith("level"):
        return whole.level is not None and len(_levels(whole)) > 2
    return kind != "another recording" or len(_files(whole)) > 1


def _levels(whole: Dataset) -> list[float]:
    """Return the levels at which the output moves."""
    moving = (c for c in whole.curves if c.level is not None and np.ptp(c.columns[whole.target]))
    return sorted({curve.level for curve in moving if curve.level is not None})


def _files(whole: Dataset) -> list[str]:
    """Return the files of one recording each that are long enough."""
    long = (one.source for one in whole.recordings if one.rows_kept >= LEAST_LOG)
    sources = [source.rpartition("/")[2] for source in long]
    return sorted({name for name in sources if sources.count(name) == 1})


def _split(study: str, kind: str, data: str, whole: Dataset, rng: np.random.Generator) -> str:
    """Return a split of a kind, as the spec has it."""
    levels = _levels(whole)
    if kind == "inner level":
        held = rng.choice(levels[1:-1], min(2, len(levels) - 3) or 1, replace=False)
        return f"{{{whole.level}: [{', '.join(f'{value:.10g}' for value in sorted(held))}]}}"
    if kind == "outer level":
        return f"{{{whole.level}: [{levels[-int(rng.integers(2))]:.10g}]}}"
    if kind == "last part":
        return f"{{last: {rng.uniform(0.25, 0.4):.2f}}}"
    if kind == "another recording":
        names = _files(whole)
        held = rng.choice(names, max(len(names) // 3, 1), replace=False)
        return f"{{files: [{', '.join(sorted(held))}]}}"
    ignored = search_slice(shipped(SETS[study].study, *_overrides(study, "")).spec).ignored
    of = "time" if data == "recording" else situation_of(searchable(whole), ignored).inputs[0]
    values = np.concatenate([curve.columns[of] for curve in whole.curves])
    low, width = float(values.min()), float(np.ptp(values))
    count = int(rng.integers(1, 4))
    share = 0.3 / count if data == "recording" else 0.1
    for _ in range(MOST_DRAWS):
        starts = (np.arange(count) + rng.uniform(0.1, 0.9 - share * count, count)) / count
        bands = [[low + width * s, low + width * min(s + share, 0.98)] for s in starts]
        if all(((a <= values) & (values <= b)).any() for a, b in bands):
            break
        (rng,) = rng.spawn(1)  # what is drawn for later studies stays the same
    return f"{{{of}: {{between: [{', '.join(f'[{a:.6g}, {b:.6g}]' for a, b in bands)}]}}}}"


def _overrides(name: str, split: str) -> tuple[str, ...]:
    held_out = (f"data.split={{validate: {split}}}",) if split else ()
    return (f"name=drawn_{name}{'_split' * bool(split)}", *SETS[name].changes, *held_out, *BARE)


HEADS = (
    "seed .0f",
    "revision .0f",
    "study",
    "data",
    "held out",
    "split",
    "structure found",
    "parameters .0f",
    "found [%] .3g",
    "best other [%] .3g",
    "which",
    "found / best other .2f",
    "best in the list [%] .3g",
    "found / best in the list .2f",
    "work [s] .0f",
    "told on its page",
    "alerts",
)


def measured(draw: Draw, runs: Path, other: Sequence[Cell]) -> tuple[Cell, ...]:
    """Return the row of a split behind its seed and revision; `other`, the error and the name of
    the best other model, is fitted where it is empty.
    """
    one = SETS[draw.study]
    rivals = "null" if other else f"[{', '.join(one.rivals)}]"
    settings = (*_overrides(draw.study, draw.split), f"validate.against={rivals}")
    files = run(one.study, runs, *settings)
    search = files.search()
    assert search is not None
    errors = {model: 100 * score.nrmse for model, score in scores(files).items()}
    own = errors.pop(OWN)
    errors.pop("repeatability", None)
    least, which = other or min((error, model) for model, error in errors.items())
    assert isinstance(least, float)
    best = own * _best_share(files, search_slice(shipped(one.study, *settings).spec))
    ratio = own / least
    alerts = alerts_without_rivals(files)
    told = "" if ratio <= WORSE else says_so(alerts)
    seconds = sum(tried.seconds for tried in search.tried)
    return (
        *draw,
        search.found.words,
        search.found.parameters,
        own,
        least,
        which,
        ratio,
        best,
        own / best,
        seconds,
        told,
        ", ".join(alerts),
    )


def _best_share(files: RunFiles, part: Any) -> float:
    """Return the held-out error of the best structure in the list over that of the one found."""
    search, dataset = files.search(), files.dataset()
    assert search is not None
    errors: dict[str, float] = {}
    for tried in search.tried:
        if tried.family in (BLACK_BOX, "papers") or not tried.errors:
            continue
        try:
            model = refit(choices_of(tried.sections, part), dataset)
            missed = [_missed(model, curve, dataset.target) for curve in dataset.curves]
        except MapmoreError:
            continue
        errors[tried.words] = float(np.sqrt(np.mean(np.concatenate(missed) ** 2)))
    found = errors[search.found.words]
    return min((error for error in errors.values() if np.isfinite(error)), default=found) / found


def _missed(model: Any, curve: Any, target: str) -> Array:
    if not curve.held_out.any():
        return np.empty(0)
    says = forecast(model, curve)
    missed: Array = (says.values - curve.columns[target])[curve.held_out & says.ready]
    return missed


def kept_rows() -> list[tuple[Cell, ...]]:
    """Return the rows that the page has."""
    if "search/drawn.csv" not in PAGE.read_text(encoding="utf-8"):
        return []
    return [tuple(map(_number, row)) for row in read_rows(PAGE, "drawn")[1:]]


def table(runs: Path, seed: int, draw: Draw) -> Table:
    """Return the table with the row of one split made anew."""
    key = (seed, STAGE.revision, draw.study)
    rows = [row for row in kept_rows() if row[:3] != key]
    others = [row[9:11] for row in rows if (row[0], *row[2:6]) == (seed, *draw)]
    rows.append((*key[:2], *measured(draw, runs, others[0] if others else ())))
    rows.sort(key=lambda row: row[:2])
    return Table.of("drawn", "NRMSE on splits that were drawn by a seed", HEADS, rows)


def _number(cell: str) -> Cell:
    try:
        return None if cell == "–" else float(cell)
    except ValueError:
        return cell


def summary(rows: Sequence[tuple[Cell, ...]]) -> Table:
    """Return one row for each seed, revision and kind of split, and for all tables and recordings
    of a seed and a revision.
    """
    heads = (
        "seed .0f",
        "revision .0f",
        "data",
        "held out",
        "splits .0f",
        "as good as the best other .0f",
        f"within {NEAR:g} times .0f",
        "geometric mean .2f",
        "worst .2f",
        f"above {WORSE:g} times .0f",
        "of these reported .0f",
        "found / best in the list .2f",
    )
    lines = []
    for seed, revision in sorted({row[:2] for row in rows}):
        for data, kinds in (("table", OF_TABLES), ("recording", OF_RECORDINGS)):
            for kind in ("all", *kinds):
                some = [
                    row
                    for row in rows
                    if (row[0], row[1], row[3]) == (seed, revision, data)
                    and kind in ("all", row[4])
                ]
                if some:
                    lines.append((seed, revision, data, kind, *_summed(some)))
    lines.sort(key=lambda line: line[3] == "all")  # the page shows the last rows
    return Table.of(
        "drawn_summary", "Splits that were drawn by a seed, by kind of data", heads, lines
    )


def _summed(rows: Sequence[tuple[Cell, ...]]) -> tuple[Cell, ...]:
    ratios, regrets = (np.array([row[place] for row in rows], dtype=float) for place in (11, 13))
    mean, regret = (float(np.exp(np.mean(np.log(each)))) for each in (ratios, regrets))
    counts = [int(np.sum(ratios <= bound)) for bound in (SLACK, NEAR)]
    told = [row[15] for row in rows if row[15]]
    return (len(rows), *counts, mean, float(ratios.max()), len(told), told.count("yes"), regret)


if __name__ == "__main__":
    folder, (number, *names) = asked()
    for draw in drawn(int(number), folder):
        if draw.study in (names or SETS):
            write_tables(PAGE, {"drawn": partial(table, folder, int(number), draw)})
            write_tables(PAGE, {"drawn_summary": lambda: summary(kept_rows())})
