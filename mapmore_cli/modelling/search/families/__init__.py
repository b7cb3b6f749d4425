"""Families of candidates, one small file each with a `FAMILY`; who adds one adds its file, and its turn in `ORDER`."""

from __future__ import annotations

from importlib import import_module

from mapmore_cli.modelling.search.candidate import Family

ORDER = (
    "surface",
    "arx",
    "lags",
    "slow_and_play",
    "friction",
    "friction_states",
    "autoregression",
    "rich",
    "loops",
    "rise_and_fall",
    "steep",
    "splines",
    "on_formula",
    "formula",
    "levels",
    "sections",
    "found_lag",
    "free_run",
)
"""Names of the files in the order in which they are tried: where time is short, the last ones are left out."""

FAMILIES: dict[str, Family] = {name: import_module(f"{__name__}.{name}").FAMILY for name in ORDER}
