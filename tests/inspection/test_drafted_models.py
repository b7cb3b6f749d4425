"""What `init` writes for specimens that the names of files distinguish, and for several outputs."""

from __future__ import annotations

import numpy as np
import yaml
from recorded import checked, drafted, drafts, loaded, write

from mapmore_cli.annexes.drafting.answers import Answers, answers_of
from mapmore_cli.annexes.drafting.outputs import as_files
from mapmore_cli.annexes.search.stage import search_slice
from mapmore_cli.study.loader import load

T = 0.02 * np.arange(600)


def pull(path, bar, strength):
    k = np.arange(40)
    write(
        path,
        {"P_kPa": 100 * bar, "eps": k / 300, "F_N": 100 * bar * strength - 9 * k + 0.02 * k**2},
    )


def test_the_groups_are_no_input_of_a_search(tmp_path):
    for number, word in ((1, "blue"), (2, "red")):
        for bar in (1, 2, 3):
            pull(tmp_path / f"{word}_pull_{bar}bar.csv", bar, 2 + number)
    draft = drafted(tmp_path, answers=Answers(group="specimen"))
    # the group explains the difference at equal inputs
    assert draft.data["groups"] == {"of": "specimen", "offset": True}
    assert draft.data["files"] == [
        {"path": f"{word}_pull_*.csv", "set": {"specimen": number}}
        for number, word in ((1, "blue"), (2, "red"))
    ]
    spec = checked(draft, tmp_path).spec
    assert search_slice(spec).ignored == ("force", "specimen")


def test_several_outputs_share_a_file_and_are_a_campaign(tmp_path):
    drive = 3 + 2 * np.sin(0.7 * T) * np.cos(0.31 * T)
    columns = {"t [s]": T, "P [bar]": drive, "q [mm]": drive**2, "r [V]": np.tanh(drive)}
    write(tmp_path / "rig" / "log.csv", columns)
    said = answers_of(target="q,r", inputs="P")
    found = drafts(tmp_path / "rig", name="arm", answers=said)
    assert [(one.name, one.of, one.output) for one in found] == [
        ("arm-q", "arm", "q"),
        ("arm-r", "arm", "r"),
    ]
    files = as_files(found, tmp_path / "rig" / "arm.yaml")
    assert [path.name for path in files] == [
        *("arm.yaml", "_arm.yaml", "arm-q.yaml", "arm-r.yaml"),
    ]
    for path, (text, _) in files.items():
        path.write_text(text, encoding="utf-8")
    first, shared, *specs = files
    runs = yaml.safe_load(first.read_text())
    assert runs["runs"] == [{"base": "arm-q.yaml"}, {"base": "arm-r.yaml"}]
    assert runs["campaign"] == "arm"
    assert "batch" in first.read_text().splitlines()[0]
    common = yaml.safe_load(shared.read_text())
    assert {*common["data"]["columns"]} == {"time", "pressure"}
    assert "target" not in common
    for draft, path in zip(found, specs, strict=True):
        own = yaml.safe_load(path.read_text())
        assert own["extends"] == "_arm.yaml"
        assert own["data"].keys() == {"columns"}
        assert own["data"]["columns"].keys() == {draft.output}
        assert own["units"] == {draft.output: {"q": "mm", "r": "V"}[draft.output]}
        assert load(path).spec == loaded(draft, tmp_path / "rig").spec
    only = as_files(found[:1], None)
    assert [path.name for path in only] == ["arm.yaml"]
