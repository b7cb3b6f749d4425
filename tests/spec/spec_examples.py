"""Documents for the tests of the spec, and a short way to load them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.spec.loader import LoadedSpec, load

STATIC = """\
schema_version: 1
name: dmsp-20-88-static
muscle: {name: Festo DMSP-20-88N, kind: mckibben, length: 88 mm, diameter: 20 mm}
data:
  files: ["../datasets/mckibben/load_cycle_*.csv"]
  reader: csv
  columns:
    time:     {column: t, unit: s}
    pressure: {column: P, unit: kPa}
    strain:   {column: eps}
    force:    {column: F, unit: N}
  cycles: {over: strain, samples: 200}
  levels: {of: pressure, at: [80, 150, 250, 350]}
  split: {validate: {pressure: [250]}}
target: static
segment:
  strain: {method: even, count: 4}
dictionary:
  - polynomial: {of: [strain], order: 4}
  - terms: ["exp(-strain/0.02)"]
fit:  {scaling: unit_square, max_terms: 1, tolerance: 1.0e-4}
fuse: {transition: linear, z_s: 0.25, extrapolation: continue}
validate:
  against: [sarosi, polynomial_2]
  require: {nrmse: 0.05}
report: {figures: [data, fit, error, nrmse], formats: [html, csv, svg]}
"""

MEASURED = """\
name: festo.10mm_20cm
units: {pressure: bar}
data:
  files:
    - {path: "10mm_Unkink_*.csv.gz", set: {length: 182 mm}}
    - {path: "10mm_kinked25_*.csv.gz", set: {length: 17.45 cm}, id: kinked, keep: [{quantity: time, outside: [1 min, 70 s]}]}
    - plain.csv
  header: false
  columns:
    force: {column: 0, unit: kN, scale: -1, offset: 9 N}
    pressure: {column: 1, unit: psi, offset: 1 bar}
    time: {column: 2, unit: ms}
  missing: drop
  repeated_time: average
  derive:
    strain: "(0.182 - length)/0.182"
    pressure_rate: {rate_of: pressure, window: 30 ms, order: 2}
    speed: {rate_of: length, window: 0.03}
  keep:
    - {quantity: pressure_rate, abs_below: 25 kPa/s}
    - {quantity: time, between: [40 s, 15 min]}
    - {quantity: speed, below: 5 mm/s}
  levels: {of: strain, at: [0, 4 %, 0.08], within: 1 %}
  split:
    validate:
      strain: [4 %]
      pressure: {between: [[200 kPa, 2.6], [400 kPa, 460 kPa]]}
      files: ["*_Test10*"]
      fraction: 25 %
      seed: 3
target: {column: force}
segment: {strain: none, pressure: {method: breakpoints, at: [100 kPa, 2]}}
dictionary: [polynomial: {of: [pressure, strain], order: 3, constant: false}]
model: {type: mapmore, backbone: sarosi}
fit: {max_terms: 3, stop: bic, scaling: max_abs}
fuse:
  transition: cubic
  extrapolation: {strain: {below: 1 %, above: saturate}, pressure: continue_linear}
validate:
  against: [sarosi, {model: sarosi, method: levenberg_marquardt, as: sarosi_lm}]
  require: {rmse: 5 mN, nrmse: 5 %, r2: 0.9}
report: {published: {source: W, nrmse: {sarosi: 2.5 %}, rmse: {sarosi: 12}}}
"""

LOGS = """\
name: logs
data:
  files: ["*.txt"]
  header: 2
  skip_rows: 1
  delimiter: ";"
  decimal: ","
  encoding: latin-1
  columns: {time: {column: t, unit: ms}, force: {column: F, unit: N}}
  join:
    - files: [two.mat]
      reader: mat
      root: "train[*]"
      columns: {pressure: {column: "run.P", unit: psi, offset: 1 bar}, time: {column: "t[:,0]"}}
      on: time
      shift: -40.2 s
      max_gap: 100 ms
    - {files: [three.xlsx], reader: xlsx, sheet: Run1, columns: {strain: {column: 2}}, on: row}
  gaps: {longer_than: 10 ms, action: split}
  resample: 0.5 ms
target: static
model: {type: literature, name: sarosi}
"""

FORMULA = """\
name: formula
data: {files: [a.csv], columns: {pressure: {column: 1}, strain: {column: 2}, force: {column: 3}}}
target: static
model: {type: literature, name: sarosi}
"""

GOOD = {"static": STATIC, "measured": MEASURED, "logs": LOGS, "formula": FORMULA}


def load_text(folder: Path, text: str | bytes, overrides: Sequence[str] = ()) -> LoadedSpec:
    """Load a document, written to `spec.yaml`."""
    path = folder / "spec.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return load(path, overrides)


def refusal(folder: Path, text: str | bytes, overrides: Sequence[str] = ()) -> str:
    """The message with which a document is refused; paths start at `folder`."""
    with pytest.raises(SpecError) as caught:
        load_text(folder, text, overrides)
    return str(caught.value).replace(f"{folder}/", "")


def refuse_slip(folder: Path, base: str, old: str, new: str, words: list[str]) -> None:
    """Put `new` in place of `old`: one message has to name the place of its mark (a triangle, which is left out) and hold the words."""
    assert old in base
    before, after = base.replace(old, new, 1).split("▸")
    place = f"{before.count(chr(10)) + 1}:{len(before) - before.rfind(chr(10))}"
    message = refusal(folder, before + after)
    assert message.startswith(f"spec.yaml:{place}: "), message
    assert all(word in message for word in words), message
    assert message.count("spec.yaml:") == 1, message
