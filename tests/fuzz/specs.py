"""Specs: documents that are valid, changed by the schema; what loads is written out, loads again to
the same, and one in ten runs.

Most inputs are YAML without a fault of syntax: a key is left out, put in by the schema, renamed,
given a hostile value, or another part of the documents. One in ten is changed as text.
"""

import json
import math
import shutil
from copy import deepcopy
from functools import cache
from pathlib import Path

import numpy as np
import yaml
from driver import Fault, Target, at, changed_text, changed_tree, refused, ways

from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.pipeline.runner import bring_up_to_date
from mapmore_cli.study.loader import load
from mapmore_cli.study.units import convert

PROJECT = Path(__file__).resolve().parents[2]

STATIC = """
name: static
data:
  files: ["study_*.csv"]
  columns: {pressure: {column: P, unit: kPa}, strain: {column: eps}, force: {column: F, unit: N}}
  levels: {of: pressure, at: [100, 200]}
  split: {validate: {fraction: 0.25, seed: 1}}
target: static
segment: {strain: {method: even, count: 2}}
dictionary: [{polynomial: {of: [strain], order: 2}}, {terms: ["exp(-strain/0.1)"]}]
fit: {max_terms: 2, stop: bic}
fuse: {transition: cubic, z_s: 0.25, extrapolation: saturate}
validate: {against: [polynomial_2]}
report: {figures: [], formats: [csv]}
"""

MEMORY = """
name: memory
data:
  files: ["study_*.csv"]
  columns: {time: {column: t, unit: s}, pressure: {column: P, unit: kPa}, strain: {column: eps},
      force: {column: F, unit: N}}
  derive: {pressure_rate: {rate_of: pressure, window: 300 ms, order: 2}}
  resample: 100 ms
  split: {validate: {last: 0.3}}
target: {column: strain}
dictionary:
  - products:
      of: [{lags: {of: [pressure], steps: [0, 1]}}, {slow: {of: [pressure], tau: [0.5]}},
          {play: {of: [force], count: 2}}]
      order: 2
fit: {max_terms: 3, stop: bic, ridge: auto}
report: {figures: [], formats: [csv]}
"""

FORMULA = """
name: formula
data:
  files:
    - {path: study_1.csv, set: {displacement: 3 mm}, id: one, keep: [{quantity: force,
        above: -50 N}]}
    - {path: study_2.csv, set: {displacement: 4 mm}}
  columns: {pressure: {column: P, unit: kPa}, strain: {column: eps}, force: {column: F, unit: N}}
  keep: [{quantity: strain, between: [0, 0.2]}]
  missing: drop
target: static
model: {type: literature, name: sarosi}
validate: {against: [polynomial_2, {model: sarosi, method: levenberg_marquardt, as: other}],
    require: {nrmse: 0.9}}
report: {figures: [], formats: [csv]}
"""

SECTIONS = """
name: sections
data:
  files: ["study_*.csv"]
  columns: {time: {column: t, unit: s}, pressure: {column: P, unit: kPa}, strain: {column: eps}}
target: {column: strain}
model: {type: state_space, input: pressure, sections: [150], direction: false,
    solver: least_squares}
report: {figures: [], formats: [csv]}
"""

STATIC_TREE, MEMORY_TREE = yaml.safe_load(STATIC), yaml.safe_load(MEMORY)
BASES = [STATIC_TREE, MEMORY_TREE, yaml.safe_load(FORMULA), yaml.safe_load(SECTIONS)]
NUMBERS = (
    0,
    1,
    2,
    -1,
    0.5,
    1e-9,
    1e9,
    1e300,
    -0.0,
    5e-324,
    math.inf,
    math.nan,
    10**30,
    3,
    7,
    20,
    250,
)
TEXTS = (
    *(
        "",
        "x",
        "strain",
        "pressure",
        "time",
        "auto",
        "none",
        "5 kPa",
        "3 m",
        "1e3 N/mm",
        "${HOME}",
        "${X:-2}",
        "../../etc/passwd",
        "*",
    ),
    *(
        "**/*",
        "[",
        "\u0430",
        "a" * 300,
        "\x1b[2J",
        "=1+1",
        "9" * 500,
        "1e999 kPa",
        "2 kg^20",
        "force[k-1]",
        "exp(strain)",
        "1/0",
        "off",
    ),
    *("~", "<<", "\ufeff", "study_1.csv"),
)
MARKS = "{}[]:,-#&*!|>'\"%@` \n\t?\\0123456789abc<~é\x07"


@cache
def schema():
    return json.loads((PROJECT / "configs" / "experiment.schema.json").read_text())


def value_of(rule, chance, depth=0):
    """A value that keeps to a rule of the schema, as far as this is told by it."""
    if "$ref" in rule:
        return value_of(schema()["$defs"][rule["$ref"].rsplit("/", 1)[1]], chance, depth)
    for key in ("oneOf", "anyOf"):
        if key in rule:
            return value_of(chance.choice(rule[key]), chance, depth)
    if "enum" in rule:
        return chance.choice(rule["enum"])
    if "const" in rule:
        return rule["const"]
    match rule.get("type"):
        case "object":
            return _mapping_of(rule, chance, depth)
        case "array":
            if "prefixItems" in rule:
                return [value_of(item, chance, depth + 1) for item in rule["prefixItems"]]
            return [
                value_of(rule.get("items", {"type": "string"}), chance, depth + 1)
                for _ in range(chance.choice([0, 1, 1, 2, 3]))
            ]
        case "integer":
            return chance.choice(
                [
                    rule.get("minimum", 0),
                    min(rule.get("maximum", 9), chance.randrange(10)),
                    chance.choice(NUMBERS),
                ]
            )
        case "number":
            return chance.choice([chance.random(), chance.randrange(300), chance.choice(NUMBERS)])
        case "boolean":
            return chance.random() < 0.5
        case "null":
            return None
    return (
        f"{chance.randrange(400)} {chance.choice(['kPa', 'ms', 'N', '%', 'mm', 's', 'bar'])}"
        if "pattern" in rule
        else chance.choice(TEXTS)
    )


def _mapping_of(rule, chance, depth):
    known = rule.get("properties", {})
    wanted = [
        name
        for name in known
        if name in rule.get("required", ()) or chance.random() < (0.35 if depth < 2 else 0.1)
    ]
    found = {name: value_of(known[name], chance, depth + 1) for name in wanted}
    inner = next(iter(rule.get("patternProperties", {}).values()), rule.get("additionalProperties"))
    if isinstance(inner, dict):
        found |= {
            chance.choice(TEXTS[1:6]): value_of(inner, chance, depth + 1)
            for _ in range(chance.randrange(3))
        }
    return found


def changed(tree, chance):
    """Change a document at one place, or put something in by the schema."""

    def value(old):
        return chance.choice(
            NUMBERS if isinstance(old, int | float) or chance.random() < 0.3 else TEXTS
        )

    kind = chance.randrange(10)
    if kind == 0 and chance.random() < 0.3:
        place = chance.choice([way for way in ways(tree) if way])
        holder = at(tree, place[:-1])
        holder[place[-1]] = _long(holder[place[-1]], chance)
    elif kind > 3:
        changed_tree(tree, chance, value, chance.choice(BASES))
    else:
        section = chance.choice(list(schema()["properties"]))
        rule = schema()["properties"][section]
        ref = rule.get("$ref") or next(
            (item["$ref"] for item in rule.get("oneOf", ()) if "$ref" in item), None
        )
        known = schema()["$defs"][ref.rsplit("/", 1)[1]].get("properties", {}) if ref else {}
        if isinstance(tree.get(section), dict) and known:
            key = chance.choice(list(known))
            tree[section][key] = value_of(known[key], chance)
        elif section != "extends" or chance.random() < 0.1:
            tree[section] = value_of(rule, chance)


def _long(value, chance):
    """A list of thousands of what stands there, of numbers, or of lists of numbers: up to 200 kB
    where one or two values belong.
    """
    length = chance.choice([300, 3000, 20_000])
    numbers = list(range(length))
    pairs = [[n, n + 1] for n in numbers[: length // 2]]
    return chance.choice(
        [numbers, [numbers], pairs, [value] * (length // 10), ["strain"] * (length // 2)]
    )


def text_of(chance, changes=(0, 1, 1, 1, 2, 3)):
    """An input: a valid document with as many changes as one of `changes` says, as YAML."""
    tree = deepcopy(chance.choice(BASES))
    for _ in range(chance.choice(changes)):
        changed(tree, chance)
    text = as_yaml(tree)
    return changed_text(text, chance, MARKS) if chance.random() < 0.1 else text


def as_yaml(tree):
    """A document as text, by libyaml: a tenth of the time of what is written in Python."""
    return str(
        yaml.dump(tree, Dumper=yaml.CSafeDumper, allow_unicode=True, sort_keys=False, width=200)
    )


def write_data(folder):
    """Two recordings of 20 rows: a study of 40."""
    for number in (1, 2):
        time = np.arange(20) * 0.1
        strain = np.linspace(0, 0.15, 20)
        force = 200.0 * number * (1 - 3 * strain) - 40 + np.sin(9 * time)
        rows = [
            f"{t:.2f},{100 * number + i % 3},{e:.4f},{f:.3f}"
            for i, (t, e, f) in enumerate(zip(time, strain, force, strict=True))
        ]
        (folder / f"study_{number}.csv").write_text("\n".join(["t,P,eps,F", *rows]) + "\n")


def is_yaml(text):
    """Whether libyaml, which mapmore does not read with, finds no mistake of syntax."""
    try:
        yaml.compose(text, Loader=yaml.CSafeLoader)
    except (yaml.YAMLError, UnicodeError):
        return False
    return True


def attempt(chance, number, folder):
    """Load; every second one that loads is written out and loads again to the same."""
    path, text = folder / "spec.yaml", text_of(chance)
    path.write_text(text, encoding="utf-8", errors="surrogatepass")
    try:
        loaded = load(path)
    except MapmoreError as error:
        return refused(error) if is_yaml(text) else "no YAML"
    if number % 2:
        path.write_text(loaded.resolved, encoding="utf-8")
        if load(path).spec != loaded.spec:
            raise Fault("its resolved form loads to another spec")
    return "loaded"


def warm(folder):
    """Load every document, with units that only the registry of units knows."""
    convert(1.0, "lbf/ft^2", "kPa")
    path = folder / "spec.yaml"
    return [load(path) for tree in BASES if path.write_text(as_yaml(tree))]


DONE = "done"  # the folder with the runs of all documents as they are


def warm_runs(folder):
    write_data(folder)
    for loaded in warm(folder):
        bring_up_to_date(loaded, folder / DONE)


def run(chance, number, folder):
    """The next spec that loads is run on 40 rows, beginning where it differs from the document that
    was changed.
    """
    path = folder / "spec.yaml"
    while True:
        path.write_text(
            text_of(chance, (1, 1, 1, 2, 3)),
            encoding="utf-8",
            errors="surrogatepass",
        )
        try:
            loaded = load(path)
            break
        except MapmoreError:
            continue
    runs = folder / f"runs{number}"
    if (folder / DONE / loaded.spec.name).is_dir():
        shutil.copytree(folder / DONE / loaded.spec.name, runs / loaded.spec.name)
    try:
        bring_up_to_date(loaded, runs, warn=lambda _message: None)
    except MapmoreError as error:
        return refused(error)
    finally:
        shutil.rmtree(runs, ignore_errors=True)
    return "done"


TARGET = Target("specs", attempt, past=("loaded", "refused (exit 3)"), warm=warm)
RUNS = Target(
    "runs",
    run,
    past=("done", *(f"refused (exit {code})" for code in (3, 4, 5, 6))),
    longest=20,  # the number of terms of a model with memory is chosen by some thirty fits
    warm=warm_runs,
)
