"""Small studies for tests of many runs."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

SPEC = """\
schema_version: 1
name: {name}
data:
  files: ["{data}_*.csv"]
  columns: {{pressure: {{column: P, unit: kPa}}, strain: {{column: eps}}, force: {{column: F, unit: N}}}}
  levels: {{of: pressure, at: [100, 200, 300]}}
  split: {{validate: {{pressure: [200]}}}}
target: static
segment: {{strain: {{method: {method}, count: 2}}}}
dictionary: [{{polynomial: {{of: [strain], order: 3}}}}]
validate: {{against: [polynomial_2]}}
report: {{figures: [], formats: [csv]}}
"""


def write_recordings(folder: Path, data: str = "rig", samples: int = 40) -> None:
    """A recording for each of three pressures; the force is `2 P (1 - 3 eps) - 40`, slightly noisy."""
    rng = np.random.default_rng(5)
    for level in (100, 200, 300):
        strain = np.linspace(0.0, 0.05 + 0.0004 * level, samples)
        force = 2 * level * (1 - 3 * strain) - 40 + rng.normal(0, 0.3, strain.size)
        table = np.column_stack([np.full(samples, level), strain, force])
        np.savetxt(folder / f"{data}_{level}.csv", table, fmt=["%d", "%.5f", "%.3f"], delimiter=",", header="P,eps,F", comments="")


def write_study(folder: Path, name: str, data: str = "rig", method: str = "even") -> Path:
    """A spec of these recordings, which are written where they are missing."""
    if not (folder / f"{data}_100.csv").is_file():
        write_recordings(folder, data)
    spec = folder / f"{name}.yaml"
    spec.write_text(SPEC.format(name=name, data=data, method=method))
    return spec


def write_slow_study(folder: Path, name: str) -> Path:
    """A study whose segmentation takes many seconds, so that a test can end it at work."""
    if not (folder / "long_100.csv").is_file():
        write_recordings(folder, "long", 15_000)
    return write_study(folder, name, "long", "optimal")


def wait_until(true: Callable[[], bool], seconds: float = 30.0) -> None:
    """Wait for something that another process does."""
    deadline = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)
