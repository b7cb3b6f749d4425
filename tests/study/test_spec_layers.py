"""What lies over and under a file: the environment, inherited files, overrides of the command
line.
"""

import re

import pytest
from common import parts, rows_of
from spec_examples import FORMULA, STATIC, assert_says, load_text, refusal

from mapmore_cli.domain.errors import SpecError, UsageError
from mapmore_cli.study.loader import load
from mapmore_cli.study.variables import expand, readable_variables
from mapmore_cli.study.yaml_dumper import as_overrides

# Environment
# --------------------------------------------------------------------------------------------------


def test_variables_are_expanded(monkeypatch):
    monkeypatch.setenv("MAPMORE_LAB", "lab7")
    monkeypatch.setenv("MAPMORE_EMPTY", "")
    monkeypatch.delenv("MAPMORE_UNSET", raising=False)
    assert (
        expand(
            "${MAPMORE_LAB}/${MAPMORE_UNSET:-a "
            "b}/${MAPMORE_LAB:-x}${MAPMORE_EMPTY:-y}${MAPMORE_EMPTY}${MAPMORE_UNSET:-}"
        )
        == "lab7/a b/lab7y"
    )
    assert expand("$LAB $ {LAB} $${MAPMORE_LAB} }") == "$LAB $ {LAB} ${MAPMORE_LAB} }"


def test_specs_may_read_variables_of_mapmore_and_those_that_are_named(monkeypatch):
    for name in ("MAPMORE_LAB", "ROOM", "SECRET"):
        monkeypatch.setenv(name, name.lower())
    monkeypatch.setenv("MAPMORE_ENV", "RIG,ROOM")
    found = readable_variables()
    assert {name for name in found if not name.startswith("MAPMORE_")} == {"ROOM"}
    assert (found["MAPMORE_LAB"], found["ROOM"]) == ("mapmore_lab", "room")


@pytest.mark.parametrize(
    "text", ["${}", "${1A}", "${A", "${A:b}", "${A-b}", "${A:-${B}}", "${ A }"]
)
def test_what_is_no_variable_is_refused(text):
    with pytest.raises(ValueError, match="is not"):
        expand(text)


@pytest.mark.parametrize(
    "text",
    [
        "fit:\n  max_terms: ${MAPMORE_TERMS}",
        "muscle: {name: 'a ${MAPMORE_KEY} b'}",
        "muscle: {length: '${MAPMORE_TERMS} mm'}",
    ],
)
def test_variables_stand_in_paths_alone(tmp_path, monkeypatch, text):
    monkeypatch.setenv("MAPMORE_TERMS", "3")
    monkeypatch.setenv("MAPMORE_KEY", "secret")
    message = refusal(tmp_path, FORMULA + text)
    assert (
        "in a text that is not a path: environment variables are replaced only in paths" in message
    )
    assert "secret" not in message


def test_only_variables_of_ours_are_read(tmp_path, monkeypatch):
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "secret")
    text = FORMULA.replace("[a.csv]", '["${AWS_SECRET_ACCESS_KEY:-x}/a.csv"]')
    message = refusal(tmp_path, text)
    assert "spec.yaml:2:16: the environment variable AWS_SECRET_ACCESS_KEY is not read" in message
    assert "secret" not in message
    monkeypatch.setenv("MAPMORE_ENV", "LAB,AWS_SECRET_ACCESS_KEY")
    assert load_text(tmp_path, text).spec.data.files == ["secret/a.csv"]


def test_an_unset_variable_is_an_error_at_its_place_and_hides_no_other(tmp_path, monkeypatch):
    monkeypatch.delenv("MAPMORE_NOWHERE", raising=False)
    text = FORMULA.replace("[a.csv]", '["${MAPMORE_NOWHERE}/a.csv"]') + "fit:\n  stpo: bic\n"
    message = refusal(tmp_path, text)
    assert "spec.yaml:2:16: the environment variable MAPMORE_NOWHERE is not set" in message
    assert "${NAME:-default}" in message
    assert "spec.yaml:6:3: unknown key `stpo`" in message
    assert message.count("spec.yaml:") == 2


def test_a_variable_in_the_value_of_a_variable_is_not_expanded_again(tmp_path, monkeypatch):
    monkeypatch.setenv("MAPMORE_ODD", "${MAPMORE_HOME}")
    loaded = load_text(
        tmp_path,
        FORMULA.replace("[a.csv]", '["${MAPMORE_ODD}/a.csv"]') + "muscle: {name: '$${ODD}'}\n",
    )
    assert loaded.spec.data.files == ["${MAPMORE_HOME}/a.csv"]
    assert loaded.spec.muscle.name == "${ODD}"
    assert load_text(tmp_path, loaded.resolved).spec == loaded.spec


# Inheritance
# --------------------------------------------------------------------------------------------------


@pytest.fixture
def family(tmp_path):
    """`child/spec.yaml` extends `../base.yaml`, which extends `deep/root.yaml`."""
    for folder in ("child", "deep"):
        (tmp_path / folder).mkdir()
    (tmp_path / "deep" / "root.yaml").write_text(STATIC)
    (tmp_path / "base.yaml").write_text(
        "extends: deep/root.yaml\nfit: {max_terms: 3}\nmuscle: {kind: peano}\ndata:\n  "
        "levels: {at: [1, 2 bar]}\n"
    )
    (tmp_path / "child" / "spec.yaml").write_text(
        "extends: ../base.yaml\nname: heir\ndata: {split: {validate: {pressure: [2 bar]}}}\n"
        "fuse: {z_s: 0.1}\ndictionary: [{terms: [strain]}]\n"
    )
    return tmp_path


def test_mappings_merge_deeply_and_other_values_replace(family):
    assert_says(
        load(family / "child" / "spec.yaml").spec,
        """
name: heir
muscle: {kind: peano, length: 0.088}
fit: {max_terms: 3, scaling: unit_square}
fuse: {z_s: 0.1, transition: linear}
data: {levels: {of: pressure, at: [1, 200]}}
dictionary: [{terms: [strain]}]
""",
    )


def test_relative_paths_start_at_the_file_that_they_are_written_in(family):
    loaded = load(family / "child" / "spec.yaml")
    assert loaded.folder == family / "child"
    # root.yaml lies in deep/, beside child/
    assert loaded.spec.data.files == ["../datasets/mckibben/load_cycle_*.csv"]
    (family / "base.yaml").write_text(
        "extends: deep/root.yaml\ndata: {files: [x.csv, {path: 'd/*.csv'}, /abs/y.csv], "
        "levels: {at: [1, 2 bar]}}\n"
    )
    files = load(family / "child" / "spec.yaml").spec.data.files
    assert [file if isinstance(file, str) else file.path for file in files] == [
        "../x.csv",
        "../d/*.csv",
        "/abs/y.csv",
    ]


def test_paths_in_inherited_settings_start_there_too_and_their_quantities_wait(
    family,
):
    settings = "{data.files: [x.csv, {path: d/*.csv, set: {pressure: 2 bar}}], units.pressure: bar}"
    (family / "base.yaml").write_text(
        f"extends: deep/root.yaml\nvalidate: {{against: [{{set: {settings}, as: other}}]}}\n"
    )
    rival = load(
        family / "child" / "spec.yaml", ["data.levels=null", "data.split=null"]
    ).spec.validation.against[-1]
    assert rival.set == {
        "data.files": ["../x.csv", {"path": "../d/*.csv", "set": {"pressure": "2 bar"}}],
        "units.pressure": "bar",
    }


@pytest.mark.parametrize(
    ("loc", "place"),
    [
        (("name",), "child/spec.yaml:2:1"),
        (("fit", "max_terms"), "base.yaml:2:7"),
        (("data", "columns", "force"), "deep/root.yaml:11:5"),
        (("data", "levels", "at", 1), "base.yaml:5:20"),
        (("model", "type"), "child/spec.yaml:1:1"),
        ((), "child/spec.yaml:1:1"),
    ],
)
def test_a_value_is_placed_in_the_file_that_it_or_the_section_around_it_comes_from(
    family, loc, place
):
    assert load(family / "child" / "spec.yaml").where(*loc) == f"{family}/{place}"


def test_a_mistake_in_an_inherited_file_is_shown_there(family):
    (family / "base.yaml").write_text(
        "extends: deep/root.yaml\nfit: {max_trems: 3}\ndata: {levels: {at: [1 bar, 2 bra]}}\n"
    )
    with pytest.raises(SpecError) as caught:
        load(family / "child" / "spec.yaml")
    message = str(caught.value)
    assert f"{family}/base.yaml:2:7: unknown key `max_trems`" in message
    assert f"{family}/base.yaml:3:29: unit 'bra' is unknown" in message
    assert "     2 | fit: {max_trems: 3}" in message


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("extends: spec.yaml\n", ["spec.yaml:1:10", "in a circle: spec.yaml -> spec.yaml"]),
        ("name: a\nextends: none.yaml\n", ["spec.yaml:2:10: there is no file", "none.yaml"]),
        ("extends: [a.yaml]\n", ["spec.yaml:1:10: `extends` does not name a file"]),
        ("extends: .\n", ["there is no file"]),
    ],
)
def test_what_cannot_be_extended(tmp_path, text, words):
    message = refusal(tmp_path, text)
    assert all(word in message for word in words), message


def test_a_circle_of_files_is_refused(family):
    (family / "deep" / "root.yaml").write_text("extends: ../child/spec.yaml\n")
    with pytest.raises(
        SpecError, match=r"in a circle: spec.yaml -> base.yaml -> root.yaml -> spec.yaml"
    ):
        load(family / "child" / "spec.yaml")


# Overrides
# --------------------------------------------------------------------------------------------------


def test_overrides_set_scalars_lists_items_and_new_sections(tmp_path):
    overrides = """
fit.max_terms=2
data.levels.at=[80, 1.5 bar, 250]
data.levels.at.2=300 kPa
data.split.validate.pressure.0=300
model.backbone=sarosi
muscle.length=9 cm
name=other
dictionary.0.polynomial.order=0x3
validate.require={rmse: 1}
"""
    assert_says(
        load_text(tmp_path, STATIC, overrides.split("\n")[1:-1]).spec,
        """
name: other
muscle: {length: 0.09}
data: {levels: {at: [80, 150, 300]}, split: {validate: {pressure: [300]}}}
model: {backbone: sarosi}
fit: {max_terms: 2}
validate: {require: {rmse: 1}}
""",
    )


def test_the_last_override_of_a_key_counts_and_null_restores_a_default(tmp_path):
    spec = load_text(
        tmp_path,
        STATIC,
        ["fuse.z_s=0.1", "fuse.z_s=0.2", "fuse.extrapolation=null", "data.split=", "data.split={}"],
    ).spec
    assert (spec.fuse.z_s, spec.fuse.extrapolation, spec.data.split.hold_out) == (0.2, None, None)


@pytest.mark.parametrize(
    ("override", "words"),
    rows_of(
        """
fit.max_term=2  \
    --set fit.max_term=2: unknown key `max_term` in `fit` | did you mean `max_terms`?
fit.max_terms=two           --set fit.max_terms=two: `fit.max_terms` should be a whole number
fit.max_terms.deep=2  \
    --set fit.max_terms.deep=2: `deep` does not exist: 1 is a plain value
data.levels.at.4=2  \
    --set data.levels.at.4=2: there is no item `4` in a list of 4 | from 0
data.levels.at.-1=2         there is no item `-1`
muscle.length=3 kPa         --set muscle.length=3 kPa: unit 'kPa' (a pressure)
data.levels.of=presure      --set data.levels.of=presure: there is no quantity `presure`
fit.max_terms=[1            --set fit.max_terms=[1: not valid YAML
extends=other.yaml          --set extends=other.yaml: unknown key `extends`
data.files.0=${MAPMORE_NO}  \
    --set data.files.0=${MAPMORE_NO}: the environment variable MAPMORE_NO is not set
""",
        parts,
    ),
)
def test_a_wrong_override_is_placed_at_itself(tmp_path, override, words):
    message = refusal(tmp_path, STATIC, [override])
    assert all(word in message for word in words), message


@pytest.mark.parametrize("override", ["fit.max_terms", "=2", "fit..max_terms=2", ".=3"])
def test_an_override_of_another_form_is_wrong_usage(tmp_path, override):
    with pytest.raises(UsageError, match="not of the form"):
        load_text(tmp_path, STATIC, [override])


def test_settings_keep_their_texts_on_their_way(tmp_path):
    texts = ["${HOME}", "$${HOME}", "\N{FLEXED BICEPS}", "a: [b"]
    path = tmp_path / "spec.yaml"
    path.write_text(STATIC)
    loaded = load(path, as_overrides({"muscle.name": texts[2], "data.files": texts}))
    assert loaded.spec.muscle.name == texts[2]
    assert loaded.spec.data.files == texts


def test_null_removes_what_is_inherited(tmp_path):
    (tmp_path / "base.yaml").write_text(STATIC)
    heir = (
        "extends: base.yaml\ndata: {columns: {strain: null}, cycles: null, split: null}\n"
        "segment: null\n"
    )
    # of the dictionary
    with pytest.raises(SpecError, match="there is no quantity `strain` in this study"):
        load_text(tmp_path, heir)
    spec = load_text(tmp_path, f"{heir}dictionary: [{{terms: [pressure]}}]\nvalidate: null").spec
    assert "strain" not in spec.data.columns
    assert (spec.data.split.hold_out, spec.segment) == (None, {})
    with pytest.raises(SpecError, match="lacks the key `target`"):
        load_text(tmp_path, "extends: base.yaml\ntarget: null")
    without = load_text(tmp_path, STATIC, ["data.columns.time=null"]).spec
    assert "time" not in without.data.columns


def test_the_resolved_text_runs_in_another_folder(family, tmp_path):
    """Every relative path starts there: files, needed specs, competitors' specs and settings,
    patterns of held-out files with a folder.
    """
    variation = "{set: {data.files: [y/*.csv], fit.max_terms: 2}, as: b}"
    more = (
        f"\nneeds: {{static: ../static.yaml}}\nvalidate: {{against: [{{run: other/o.yaml}}, "
        f"{variation}]}}\n"
    )
    child = family / "child" / "spec.yaml"
    child.write_text(
        child.read_text().replace("pressure: [2 bar]", "files: [x.csv, d/*.csv]") + more
    )
    loaded = load(child)
    folder = tmp_path / "runs" / "deep" / "here"
    folder.mkdir(parents=True)
    text = loaded.resolved_in(folder)
    assert "extends" not in text
    moved = {*re.findall(r"(?:\.\./){3}([^],}\s]+)", text)}
    assert moved == {
        "datasets/mckibben/load_cycle_*.csv",
        "static.yaml",
        *(f"child/{path}" for path in ("other/o.yaml", "y/*.csv", "d/*.csv")),
    }
    (folder / "experiment.yaml").write_text(text)
    again = load(folder / "experiment.yaml")
    assert again.spec.data.split.hold_out.files[0] == "x.csv"
    assert again.resolved_in(folder) == text
    assert again.resolved_in(loaded.folder) == loaded.resolved
