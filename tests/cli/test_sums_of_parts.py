"""A joint of two muscles from YAML: what is refused when the models of other runs are known."""

import numpy as np
from cli_samples import write_columns
from spec_examples import JOINT

SINGLE = """\
name: {name}
data: {{files: [{name}.csv], columns: {{pressure: {{column: P, unit: kPa}}, strain: {{column: e}},
    force: {{column: F, unit: N}}}}}}
target: {{column: force}}
model: {{type: literature, name: chou_hannaford}}
"""
RUNS = JOINT.replace("formula: chou_hannaford, inputs", "model: flexor.yaml, inputs").replace(
    "formula: chou_hannaford, sign", "model: extensor.yaml, sign"
)


def joint(folder, spec):
    """A joint and its two muscles."""
    rng = np.random.default_rng(0)
    for name in ("flexor", "extensor"):
        pressure, strain = rng.uniform(100, 500, 60), rng.uniform(0, 0.2, 60)
        force = pressure * (2.0 * (1 - strain) ** 2 - 0.8)
        write_columns(folder / f"{name}.csv", "P,e,F", pressure, strain, force)
        (folder / f"{name}.yaml").write_text(SINGLE.format(name=name))
    columns = [rng.uniform(100, 500, 80) for _ in range(2)]
    s = rng.uniform(-0.05, 0.15, 80)
    write_columns(folder / "joint.csv", "P1,P2,s,F", *columns, s, columns[0] * (1 - s) - columns[1])
    (folder / "joint.yaml").write_text(spec)
    return folder / "joint.yaml"


def test_a_muscle_without_length_has_no_tendon(tmp_path, mapmore):
    spec = joint(tmp_path, RUNS.replace("sign: -1", "tendon: {stiffness: 1 N/mm}"))
    mapmore("validate", spec, code=3, says="does not depend on `length`")
