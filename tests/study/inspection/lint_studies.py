"""A clean study for the rules of `check`, and ways to spoil it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.spec.loader import load
from mapmore_cli.spec.yaml_loader import dump
from mapmore_cli.study.inspection.lint import Inspection, inspect
from mapmore_cli.study.inspection.rules import Issue

Table = dict[str, Array]
Spoil = Callable[[float, Table], Table]

LEVELS = (100.0, 200.0, 300.0, 400.0)
SPEC: dict[str, Any] = {
    "name": "clean",
    "muscle": {"diameter": 0.02},
    "data": {
        "files": ["level_*.csv"],
        "columns": {
            "time": {"column": "t", "unit": "s"},
            "pressure": {"column": "P", "unit": "kPa"},
            "strain": {"column": "eps"},
            "force": {"column": "F", "unit": "N"},
        },
        "levels": {"of": "pressure", "at": list(LEVELS)},
        "split": {"validate": {"pressure": [200]}},
    },
    "target": "static",
    "segment": {"strain": {"method": "even", "count": 2}},
    "dictionary": [{"polynomial": {"of": ["strain"], "order": 3}}],
    "fit": {"max_terms": 3},
}


def table(level: float, samples: int = 60) -> Table:
    """A slow pull at constant pressure."""
    strain = np.linspace(0, 0.2, samples)
    return {"t": 0.1 * np.arange(samples), "P": np.full(samples, level), "eps": strain, "F": level * (2 - 8 * strain) + level**2 / 400}


def merged(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """`over` on top of `base`, mappings merged deeply; a split and what is empty replace, None removes."""
    deep = [key for key, value in over.items() if isinstance(value, dict) and value and isinstance(base.get(key), dict) and key != "split"]
    both = {**base, **over, **{key: merged(base[key], over[key]) for key in deep}}
    return {key: value for key, value in both.items() if value is not None}


def inspected(folder: Path, spoil: Spoil = lambda _, columns: columns, names: Mapping[str, str] | None = None, **spec: Any) -> Inspection:
    """What `check` finds in the clean study with spoilt recordings, other names of columns, and a spec that is merged over its own."""
    for level in LEVELS:
        columns = {(names or {}).get(name, name): values for name, values in spoil(level, table(level)).items()}
        rows = [",".join(f"{value:.9g}" for value in row) for row in zip(*columns.values(), strict=True)]
        (folder / f"level_{level:g}.csv").write_text("\n".join([",".join(columns), *rows]) + "\n")
    path = folder / "clean.yaml"
    path.write_text(dump(merged(SPEC, spec)))
    return inspect(load(path))


def found(inspection: Inspection, severity: str | None = None) -> set[str]:
    """Ids of the issues, of one severity where it is given."""
    return {issue.id for issue in inspection.issues if severity in (None, issue.severity)}


def only(inspection: Inspection, id_: str) -> Issue:
    """The one issue of a rule."""
    (issue,) = [issue for issue in inspection.issues if issue.id == id_]
    return issue
