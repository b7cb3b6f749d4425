"""Write the table of docs/search.md that says what held-out values have influenced:
`python docs/unseen_tables.py`.

The outputs that a split holds out are turned round, and all that is fitted or chosen is made again.
A cell says whether the search, and the file of the model, are the same to the byte. It takes about
two minutes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from pages import DOCS, write_tables

from mapmore_cli.annexes.search.bench import Slice
from mapmore_cli.annexes.search.searching import search
from mapmore_cli.annexes.search.trying import choices_of
from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.recording import Curve, Dataset, Grouping, Quantity
from mapmore_cli.fitting.groups import regrouped
from mapmore_cli.fitting.kinds import refit
from mapmore_cli.modelling.pieces.recipe import Fuse
from mapmore_cli.reporting.table import Table
from mapmore_cli.storage.artefacts import write_model
from mapmore_cli.study.sections.data import Levels
from mapmore_cli.study.sections.model import ModelChoice

PAGE = DOCS / "search.md"
SAME, SEEN, NONE = "same", "SEEN", ""
PRESSURES = (100.0, 200.0, 300.0, 400.0, 500.0)
OF = Levels(of="pressure", at=list(PRESSURES))


def _dataset(target: str, level: str | None, curves: list[Curve]) -> Dataset:
    quantities = {name: Quantity(name, "1") for name in curves[0].columns}
    return Dataset(target, level, quantities, (), tuple(curves))


def _curve(name: str, level: float | None, columns: dict[str, Any]) -> Curve:
    size = len(next(iter(columns.values())))
    return Curve(name, level, columns, np.zeros(size, dtype=np.bool_), (name,))


def force_map() -> Dataset:
    """Return five pressures of a muscle, 16 samples each."""
    rng, curves = np.random.default_rng(4), list[Curve]()
    for pressure in PRESSURES:
        strain = np.linspace(0.0, 0.1 + 0.0003 * pressure, 16)
        pull = (1.1 * pressure + 90) * np.exp(-9 * strain) - pressure * strain - 60
        columns: dict[str, Array] = {
            "pressure": pressure + rng.normal(0, 0.3, 16),
            "strain": strain,
            "force": pull + rng.normal(0, 1, 16),
        }
        curves.append(_curve(f"p{pressure:g}", pressure, columns))
    return _dataset("force", "pressure", curves)


def records() -> Dataset:
    """Return three recordings of a slow system, 80 samples each."""
    rng, curves = np.random.default_rng(5), list[Curve]()
    for name in "abc":
        u = np.repeat(rng.uniform(0, 1, 10), 8)
        y = np.zeros(80)
        for k in range(1, 80):
            y[k] = 0.8 * y[k - 1] + 0.2 * u[k - 1] * (1 + 0.3 * u[k - 1])
        columns = {"time": 0.02 * np.arange(80), "u": u, "y": y + rng.normal(0, 0.005, 80)}
        columns["z"] = columns["y"] ** 2
        curves.append(_curve(name, None, columns))
    return _dataset("y", None, curves)


def _of_two_sessions(dataset: Dataset) -> Dataset:
    """Return the dataset with every second sample from another session, whose forces differ by a
    factor and an offset.
    """
    curves = []
    for curve in dataset.curves:
        session: Array = (np.arange(curve.size) % 2).astype(float)
        force: Array = (1 + 0.1 * session) * curve.columns["force"] + 5 * session
        curves.append(replace(curve, columns={**curve.columns, "session": session, "force": force}))
    grouping = Grouping("force", "session", offset=True, gain=True)
    return replace(dataset, curves=tuple(curves), grouping=grouping)


def _half(curve: Curve, held: bool) -> BoolArray:
    return np.full(curve.size, held)


def _fraction(curve: Curve) -> BoolArray:
    return np.random.default_rng(0).random(curve.size) < 0.25


def _between(name: str, low: float, high: float, curve: Curve) -> BoolArray:
    part: BoolArray = (curve.columns[name] >= low) & (curve.columns[name] <= high)
    return part


SPLITS: Mapping[str, Mapping[str, Callable[[Curve], BoolArray]]] = {
    "map": {
        "inner level": lambda c: _half(c, c.level == 300),
        "outer level": lambda c: _half(c, c.level == 500),
        "recordings": lambda c: _half(c, c.id in ("p200", "p400")),
        "last": lambda c: np.arange(c.size) >= 0.7 * c.size,
        "fraction": _fraction,
        "between": partial(_between, "strain", 0.05, 0.09),
    },
    "records": {
        "recordings": lambda c: _half(c, c.id == "b"),
        "last": lambda c: np.arange(c.size) >= 0.7 * c.size,
        "fraction": _fraction,
        "between": partial(_between, "u", 0.4, 0.6),
    },
}
SEARCHED = {
    "search of a map": ("inner level", "outer level", "recordings"),
    "search of recordings": ("recordings", "last"),
}
"""Splits of a search, which takes long: others have no cell."""

COLUMNS = ("inner level", "outer level", "recordings", "last", "fraction", "between")
PIECES: dict[str, Any] = {
    "segment": {"pressure": "levels", "strain": {"method": "even", "count": 2}},
    "dictionary": [{"polynomial": {"of": ["strain"], "order": 3}}],
    "fit": {"max_terms": 2},
}
MEMORY: dict[str, Any] = {
    "dictionary": [{"lags": {"of": ["u", "y"], "steps": [1, 2], "order": 2}}],
    "fit": {"max_terms": 4, "scaling": "range"},
}
SUM = [
    {"formula": "sarosi", "inputs": {"pressure": "pressure", "strain": "strain"}},
    {"formula": "chou_hannaford", "inputs": {"pressure": "pressure", "strain": "strain"}},
]
KINDS: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    "pieces": ("map", PIECES),
    "pieces, going on straight": ("map", {**PIECES, "fuse.extrapolation": "continue_linear"}),
    "pieces, optimal boundaries": (
        "map",
        {**PIECES, "segment": {"strain": {"method": "optimal", "count": 2, "min_samples": 4}}},
    ),
    "pieces, stop: bic": ("map", {**PIECES, "fit": {"max_terms": 3, "stop": "bic"}}),
    "pieces, stop: press": ("map", {**PIECES, "fit": {"max_terms": 3, "stop": "press"}}),
    "pieces, loss: bisquare": ("map", {**PIECES, "fit": {"max_terms": 2, "loss": "bisquare"}}),
    "pieces, shape": (
        "map",
        {**PIECES, "fit": {"max_terms": 3, "shape": {"strain": "decreasing"}}},
    ),
    "pieces, backbone: auto": ("map", {**PIECES, "model": {"backbone": "auto"}}),
    "pieces, backbone: sarosi": ("map", {**PIECES, "model": {"backbone": "sarosi"}}),
    "pieces, offset and gain of groups": ("map", PIECES),
    "one surface": (
        "map",
        {
            "segment": {"pressure": "none"},
            "dictionary": [{"polynomial": {"of": ["strain", "pressure"], "order": 3}}],
            "fit": {"max_terms": 6, "stop": "aicc"},
        },
    ),
    "formula": ("map", {"model": {"type": "literature", "name": "sarosi_hinged"}}),
    "sum": ("map", {"model": {"type": "sum", "sum": SUM}}),
    "search of a map": ("map", {}),
    "memory": ("records", MEMORY),
    "memory, ridge: auto": (
        "records",
        {**MEMORY, "fit": {"max_terms": 3, "scaling": "range", "ridge": "auto"}},
    ),
    "memory, stop: free_run": (
        "records",
        {**MEMORY, "fit": {"max_terms": 4, "scaling": "range", "stop": "free_run"}},
    ),
    "memory, shape": (
        "records",
        {**MEMORY, "fit": {"max_terms": 4, "shape": {"u": "increasing"}}},
    ),
    "two outputs": ("records", MEMORY),
    "state_space": ("records", {"model": {"type": "state_space", "input": "u"}}),
    "search of recordings": ("records", {}),
}


def made(kind: str, dataset: Dataset) -> bytes:
    """Return all that is chosen and fitted, as bytes."""
    name, sections = KINDS[kind]
    levels = OF if name == "map" else None
    part = Slice(levels, ModelChoice(type="auto"), Fuse(), {}, None, ("z",), by_level=False)
    tried = b""
    if "search" in kind:
        result = search(dataset, part, beside=False)
        tried = repr([replace(one, seconds=0.0) for one in result.tried]).encode()
        sections = result.found.sections
    model = refit(choices_of(sections, part), dataset)
    with TemporaryDirectory() as folder:
        path = Path(folder, "model.h5")
        write_model(path, replace(model, notes=(), shape=None))  # both tell held-out errors
        return tried + path.read_bytes()


def splits_of(kind: str) -> tuple[str, ...]:
    """Return the splits that a row has cells for."""
    return SEARCHED.get(kind, tuple(SPLITS[KINDS[kind][0]]))


def cell(kind: str, split: str) -> str:
    """Say whether anything has changed where the held-out outputs are turned round."""
    name, _ = KINDS[kind]
    if split not in splits_of(kind):
        return NONE
    masked = SPLITS[name][split]
    whole = force_map() if name == "map" else records()
    if kind == "two outputs":
        whole = replace(whole, also=("z",))
    if "groups" in kind:
        whole = _of_two_sessions(whole)
    outputs = (whole.target, *whole.also)
    found = []
    for turned in (False, True):
        curves = []
        for curve in whole.curves:
            out, columns = masked(curve), dict(curve.columns)
            for output in outputs:
                values = columns[output].copy()
                values[out] = 2 * values[out][::-1] + 1 if turned else values[out]
                columns[output] = values
            curves.append(replace(curve, columns=columns, held_out=out))
        found.append(made(kind, regrouped(replace(whole, curves=tuple(curves)))))
    return SAME if found[0] == found[1] else SEEN


def unseen() -> Table:
    """Return a row for each kind of model and choice, a column for each split."""
    rows = [(kind, *(cell(kind, split) for split in COLUMNS)) for kind in KINDS]
    return Table.of(
        "unseen",
        "What was chosen and fitted, after the held-out outputs were reversed",
        ("kind and choice", *COLUMNS),
        rows,
    )


if __name__ == "__main__":
    write_tables(PAGE, {"unseen": unseen})
