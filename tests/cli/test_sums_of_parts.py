"""A joint of two muscles from YAML: models of other runs added up, formulas fitted together, and
what is refused.
"""

import numpy as np
import pytest

SINGLE = """\
name: {name}
data: {{files: [{name}.csv], columns: {{pressure: {{column: P, unit: kPa}}, strain: {{column: e}},
    force: {{column: F, unit: N}}}}}}
target: {{column: force}}
model: {{type: literature, name: chou_hannaford}}
"""
JOINT = """\
name: joint
data:
  files: [joint.csv]
  columns: {{p1: {{column: P1, unit: kPa}}, p2: {{column: P2, unit: kPa}}, s: {{column: s}},
      force: {{column: F, unit: N}}}}
  split: {{validate: {{last: 0.5}}}}
units: {{p1: kPa, p2: kPa}}
target: {{column: force}}
model: {{sum: [{summands}]}}
validate: {{against: [{against}]}}
report: {{figures: []}}
"""
RUNS = (
    "{model: flexor.yaml, inputs: {pressure: p1, strain: s}}, {model: extensor.yaml, sign: "
    "-1, inputs: {pressure: p2, strain: '0.1 - s'}}"
)
FORMULAS = RUNS.replace("model: flexor.yaml", "formula: chou_hannaford").replace(
    "model: extensor.yaml", "formula: chou_hannaford"
)
TRUTH = {"flexor": (2.0, 0.8), "extensor": (1.5, 0.6)}


def pull(muscle, pressure, strain):
    c1, c2 = TRUTH[muscle]
    return pressure * (c1 * (1 - strain) ** 2 - c2)


def write(path, **columns):
    rows = [
        ",".join(f"{value:.9g}" for value in row) for row in zip(*columns.values(), strict=True)
    ]
    path.write_text("\n".join([",".join(columns), *rows]) + "\n")


def joint(folder, summands, against=""):
    rng = np.random.default_rng(0)
    for name in TRUTH:
        pressure, strain = rng.uniform(100, 500, 60), rng.uniform(0, 0.2, 60)
        write(folder / f"{name}.csv", P=pressure, e=strain, F=pull(name, pressure, strain))
        (folder / f"{name}.yaml").write_text(SINGLE.format(name=name))
    p1, p2, s = rng.uniform(100, 500, 80), rng.uniform(100, 500, 80), rng.uniform(-0.05, 0.15, 80)
    write(
        folder / "joint.csv",
        P1=p1,
        P2=p2,
        s=s,
        F=pull("flexor", p1, s) - pull("extensor", p2, 0.1 - s),
    )
    spec = folder / "joint.yaml"
    spec.write_text(JOINT.format(summands=summands, against=against))
    return spec


@pytest.mark.parametrize(
    ("summands", "words"),
    [
        (
            FORMULAS.replace("pressure: p1, ", "").replace("pressure: p2, ", ""),
            ["needs the quantity `pressure`", "both have an input"],
        ),
        (
            FORMULAS.replace("pressure: p1", "pressur: p1"),
            ["has no input `pressur`", "did you mean `pressure`?"],
        ),
        (FORMULAS.replace("pressure: p1", "pressure: p3"), ["no quantity `p3`"]),
        (FORMULAS.replace("'0.1 - s'", "'0.1 -'"), ["not an expression"]),
        (
            FORMULAS.replace("chou_hannaford", "chou_hanaford", 1),
            ["did you mean `chou_hannaford`?"],
        ),
        (
            RUNS.replace("model: flexor.yaml", "formula: chou_hannaford"),
            ["mixes models and formulas"],
        ),
        ("", ["at least 1"]),
        (
            FORMULAS.replace("sign: -1", "tendon: {stiffness: 1 N/mm}"),
            ["a formula cannot be fitted behind a tendon"],
        ),
        (RUNS.replace("sign: -1", "tendon: {stiffness: -1 N/mm}"), ["stiffness"]),
        (RUNS.replace("sign: -1", "tendon: {stiffness: 1 kg}"), ["N/m"]),
        (FORMULAS.replace("sign: -1", "sign: 2"), ["sign"]),
    ],
)
def test_wrong_sums(summands, words, tmp_path, mapmore):
    mapmore("check", joint(tmp_path, summands), code=3, says=words)


def test_a_muscle_without_length_has_no_tendon(tmp_path, mapmore):
    spec = joint(tmp_path, RUNS.replace("sign: -1", "tendon: {stiffness: 1 N/mm}"))
    mapmore("validate", spec, code=3, says="does not depend on `length`")


def test_two_runs_whose_pressures_have_one_name_are_refused(tmp_path, mapmore):
    spec = joint(tmp_path, RUNS.replace("pressure: p1, ", "").replace("pressure: p2, ", ""))
    words = ["flexor and extensor both have an input `pressure`", "inputs: {pressure: pressure_1}"]
    mapmore("run", spec, code=3, says=words)
