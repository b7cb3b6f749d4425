"""Within one command a stage is given what the one before wrote, without reading it: the files are
those of stages that run one by one.
"""

from dataclasses import replace

import pytest

from mapmore_cli.pipeline.report import collected, report_slice
from mapmore_cli.pipeline.runner import bring_up_to_date
from mapmore_cli.storage import artefacts
from mapmore_cli.storage.run_folder import RESULTS
from mapmore_cli.study.loader import load

SPEC = """schema_version: 1
name: levels
muscle: {diameter: 20 mm}
data:
  files: [d.csv]
  columns: {pressure: {column: P, unit: kPa}, strain: {column: eps}, force: {column: F, unit: N}}
  levels: {of: pressure, at: [100, 200, 300, 400]}
  split: {validate: {pressure: [300]}}
target: {column: force}
dictionary: [{polynomial: {of: [strain], order: 2}}]
report: {figures: []}
"""


def test_files_are_those_of_stages_one_by_one(tmp_path, monkeypatch):
    rows = [(p, e / 20) for p in range(100, 401, 100) for e in range(9)]
    lines = ["P,eps,F", *(f"{p},{e:.4f},{p * (1 - 2 * e**2):.4f}" for p, e in rows)]
    (tmp_path / "d.csv").write_text("\n".join(lines) + "\n")
    (tmp_path / "s.yaml").write_text(SPEC)
    loaded, one, other = load(tmp_path / "s.yaml"), tmp_path / "one" / "r", tmp_path / "other" / "r"
    for stage in (*RESULTS, "report"):
        artefacts._latest.clear()
        bring_up_to_date(loaded, one, stage)
    (inputs,) = collected(report_slice(loaded.spec), one / "levels")
    assert inputs.muscle["diameter"] == "20 mm"
    assert inputs.prefix == ""  # the only output needs no name
    assert (inputs.notes, inputs.as_recorded, inputs.other_equations) == ((), False, {})
    left_out = replace(report_slice(loaded.spec), left_out="level")
    assert collected(left_out, one / "levels")[0].notes[0].startswith("Every level is left out")
    assert inputs.style.width * 0.0254 == pytest.approx(loaded.spec.report.style.width)  # inches

    def read(kind, path, *_):
        raise AssertionError(f"{path} was read back")

    monkeypatch.setattr(artefacts.FileKind, "read", read)
    bring_up_to_date(loaded, other)
    names = [
        path.relative_to(one)
        for path in one.rglob("*")
        if path.is_file() and path.name not in ("run.json", ".lock")
    ]
    assert len(names) > 20
    for name in names:
        assert (one / name).read_bytes() == (other / name).read_bytes(), name
