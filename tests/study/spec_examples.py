"""Documents for the tests of the spec, and a short way to load them."""

from pathlib import Path

import pytest
import yaml

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.pipeline.differences import recorded
from mapmore_cli.study.loader import load

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
    - {path: "10mm_kinked25_*.csv.gz", set: {length: 17.45 cm}, id: kinked, keep: [{quantity: time,
        outside: [1 min, 70 s]}]}
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

MOTION = """\
name: motion
data:
  files: ["*.csv"]
  columns: {time: {column: t}, pressure: {column: p}, load: {column: w}, displacement: {column: x,
      unit: mm}}
  resample: 10 ms
  split: {validate: {last: 0.5}}
target: {column: displacement}
dictionary:
  - lags: {of: [displacement, pressure], steps: [1, 2], order: 2}
  - products:
      of: [pressure, "play(pressure, 0.16)", {slow: {of: [pressure], tau: [0.3 s, 1 s]}},
          {lags: {of: [displacement], steps: [5], constant: false}}]
      order: 2
      with: [pressure]
  - terms: ["pressure*displacement[k-1]", "exp(-play(pressure, 0.2)/300)"]
fit: {max_terms: 4, ridge: auto, forward: 12}
"""
RECORD = """\
schema_version: 1
name: coiled-200g
data:
  files: ["${MAPMORE_DATA:-../../shared/data}/coiled_isotonic_steps/Sample 1 Final 200 grams.xlsx"]
  reader: xlsx
  header: false
  columns: {time: {column: 2, unit: s}, pressure: {column: 3, unit: psi}, displacement: {column: 4,
      unit: mm, scale: -1}}
  gaps: {longer_than: 10 ms, action: split}
  resample: 10 ms
  split: {validate: {last: 0.5}}
target: {column: displacement}
dictionary:
  - products:
      of: [{lags: {of: [pressure], steps: [0, 1]}}, {slow: {of: [pressure], tau: [0.05, 0.5, 5]}},
          {play: {of: [pressure], count: 4}}]
      order: 2
fit: {max_terms: 12, stop: bic, ridge: auto}
"""

FORCE = """\
name: force
data: {files: [a.csv], columns: {time: {column: 0}, pressure: {column: 1}, strain: {column: 2},
    force: {column: 3}}}
target: static
dictionary: [{polynomial: {of: [pressure, strain], order: 2}}]
"""


DAMPING = """\
schema_version: 1
name: dmsp-20-88-damping
needs: {static: dmsp-20-88-static.yaml}
data:
  files: ["../datasets/mckibben/step_response_*.csv"]
  reader: csv
  columns: {time: {column: t, unit: s}, pressure: {column: P, unit: kPa}, strain: {column: eps},
      force: {column: F, unit: N}}
  derive: {strain_rate: {rate_of: strain, window: 40 ms, order: 3},
      pressure_rate: {rate_of: pressure, window: 40 ms, order: 3}}
  plateau: auto
  levels: {of: step_pressure, at: [80, 150, 250,
      350]}    # the pressure on the plateau of each recording
  split: {validate: {step_pressure: [250]}}
target: damping
segment: {direction: {of: pressure_rate, dead_band: 5 kPa/s},
    step_pressure: none}    # none | levels
dictionary:
  - polynomial: {of: [strain, strain_rate, pressure, pressure_rate], order: 2, constant: false}
fit: {max_terms: 1, train_level: highest}
validate: {against: [none, linear_viscous, reynolds, peternel, {static: sarosi, damping: reynolds}]}
"""

SEVERAL = """\
name: lever
data:
  files: ["*.csv"]
  columns: {pressure: {column: P}, force: {column: F}, tip_x: {column: x}, tip_y: {column: y}}
  levels: {of: pressure, at: [100, 200, 300]}
  split: {validate: {pressure: [200]}}
target: [tip_x, tip_y]
segment: {force: {method: even, count: 2}}
dictionary: [{polynomial: {of: [force], order: 3}}]
fit: {max_terms: 2}
validate: {simple: true}
"""

MOVING = """\
name: moving
units: {displacement: cm}
data:
  files: ["*.csv"]
  columns: {time: {column: t, unit: s}, input: {column: U, unit: V},
      displacement: {column: x, unit: mm}}
  split: {validate: {last: 0.5}}
target: {column: displacement}
model: {type: state_space, input: input, sections: [2350 mV, 3.95], direction: true, start: rest}
"""

JOINT = """\
name: joint
data:
  files: [joint.csv]
  columns: {p1: {column: P1, unit: kPa}, p2: {column: P2, unit: kPa}, s: {column: s},
      force: {column: F, unit: N}}
  split: {validate: {last: 0.5}}
units: {p1: kPa, p2: kPa}
target: {column: force}
model:
  sum:
    - {formula: chou_hannaford, inputs: {pressure: p1, strain: s}}
    - {formula: chou_hannaford, sign: -1, inputs: {pressure: p2, strain: '0.1 - s'}}
"""

FED_BACK = MOTION.replace(
    "{slow: {of: [pressure]",
    '{play: {of: ["displacement[k-1]"], count: 2}}, {slow: {of: ["stop(displacement[k-2], 0.1)"]',
)
FED_BACK = FED_BACK.replace("exp(-play(pressure, 0.2)", "exp(-slow(displacement[k-1], 0.2)")
IN_FREE_RUN = MOTION.replace("max_terms: 4", "max_terms: 4, criterion: free_run, stop: free_run")
PAST_FORCE = FORCE.replace("of: [pressure, strain]", 'of: [pressure, "force[k-1]"]')

GOOD = {
    **{
        "static": STATIC,
        "measured": MEASURED,
        "logs": LOGS,
        "formula": FORMULA,
        "damping": DAMPING,
        "motion": MOTION,
        "record": RECORD,
    },
    **{"fed back": FED_BACK, "in free run": IN_FREE_RUN, "force": FORCE, "past force": PAST_FORCE},
    **{"several": SEVERAL, "moving": MOVING, "joint": JOINT},
}

PROJECT = Path(__file__).resolve().parents[2]
SHIPPED = sorted(
    path
    for path in (PROJECT / "configs").glob("*/*.yaml")
    if not path.name.startswith("_") and path.parent.name not in ("campaigns", "papers")
)


def load_text(folder, text, overrides=()):
    path = folder / "spec.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return load(path, overrides)


def refusal(folder, text, overrides=()):
    """The message with which a document is refused; paths start at `folder`."""
    with pytest.raises(SpecError) as caught:
        load_text(folder, text, overrides)
    return str(caught.value).replace(f"{folder}/", "")


def differences(found, wanted, place=""):
    """Where a document does not say what another does."""
    if isinstance(wanted, dict) and isinstance(found, dict):
        for key, value in wanted.items():
            yield from differences(found.get(key), value, f"{place}.{key}")
    elif isinstance(wanted, list) and isinstance(found, list) and len(found) == len(wanted):
        for number, value in enumerate(wanted):
            yield from differences(found[number], value, f"{place}.{number}")
    elif found != (pytest.approx(wanted, rel=1e-9) if isinstance(wanted, float) else wanted):
        yield f"{place}: {found!r}, not {wanted!r}"


def assert_says(spec, text):
    """A spec says all that some YAML does."""
    wrong = [*differences(recorded(spec), yaml.safe_load(text))]
    assert not wrong, wrong
