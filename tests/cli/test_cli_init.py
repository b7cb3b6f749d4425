"""`init`, and what `check` prints of its drafts and of mistakes."""

import json

import pytest
from cli_samples import PROJECT, thinned

from mapmore_cli.annexes.drafting.studies import find_studies
from mapmore_cli.study.loader import load


@pytest.fixture
def rig(tmp_path):
    """A folder with the load cycles of both shipped muscles, in fewer samples, those of one with
    other titles.
    """
    for muscle in ("mckibben", "peano"):
        (tmp_path / "rig" / muscle).mkdir(parents=True)
        thinned(PROJECT / "datasets" / muscle, tmp_path / "rig" / muscle, 10)
    for path in (tmp_path / "rig" / "peano").iterdir():
        path.write_text(path.read_text().replace("t,P,eps,F", "t,P,strain,F", 1))
    return tmp_path / "rig"


@pytest.mark.parametrize("source", ["festo_datasheet", "pgm_mckibben"])
def test_a_spec_for_measured_recordings_checks(source, tmp_path, mapmore, measured_data):
    spec = tmp_path / "spec.yaml"
    assert mapmore("init", measured_data / source, "-o", spec, code=0).stdout == f"{spec}\n"
    assert serious(mapmore, spec) == []


def serious(mapmore, spec):
    """What `check` has to say beyond hints."""
    checked = mapmore("check", spec, "--json", "-q", code=0)
    return [issue for issue in json.loads(checked.stdout)["issues"] if issue["severity"] != "hint"]


def test_a_folder_of_several_studies_with_one_output_says_what_is_left_out(tmp_path, mapmore, rig):
    mapmore("init", rig, "-o", tmp_path / "one.yaml", code=0, says="left out: peano")
    assert [path.name for path in tmp_path.glob("*.yaml")] == ["one.yaml"]


def test_stdout_has_the_spec_alone(tmp_path, mapmore, document, monkeypatch, rig):
    monkeypatch.chdir(tmp_path)
    printed = mapmore("init", rig / "mckibben", "-o", "-", "--name", "bench", "-q")
    assert printed.stderr == ""
    (tmp_path / "spec.yaml").write_text(printed.stdout)
    assert document("check", "spec.yaml", "-q")["name"] == "bench"


def test_nothing_is_replaced_without_force(tmp_path, mapmore, rig):
    spec = tmp_path / "mine.yaml"
    spec.write_text("mine")
    mapmore("init", rig / "mckibben", "-o", spec, code=7, says="--force")
    assert spec.read_text() == "mine"
    mapmore("init", rig / "mckibben", "-o", spec, "--force", code=0)
    assert spec.read_text().splitlines()[1].startswith("# Started by `mapmore init`")
    assert (tmp_path / "mapmore.schema.json").read_text().startswith("{")


def test_the_schema_of_an_earlier_draft_is_no_file_that_is_left_out(tmp_path):
    for name in ("mapmore.schema.json", "other.json"):
        (tmp_path / name).write_text("{}")
    (tmp_path / "a.csv").write_text("pressure [kPa],force [N]\n1,2\n3,5\n4,6\n")
    (study,), left_out = find_studies(tmp_path)
    assert [file.name for file in study.files] == ["a.csv"]
    assert [reason.partition(":")[0] for reason in left_out] == ["other.json"]


@pytest.mark.parametrize("name", ["a/b", "", "-x y"])
def test_a_name_that_is_no_name_is_a_usage_error(name, tmp_path, mapmore):
    mapmore(
        "init", PROJECT / "datasets/mckibben", "-o", tmp_path / "a.yaml", f"--name={name}", code=2
    )
    assert not list(tmp_path.iterdir())


def test_nothing_usable_is_a_data_error(tmp_path, mapmore):
    (tmp_path / "diary.csv").write_text("dear diary\n")
    for path in (tmp_path, tmp_path / "diary.csv", tmp_path / "none"):
        assert mapmore("init", path, "-o", "-", code=4, says="error: ").stdout == ""


def test_check_ends_with_the_code_of_what_has_to_be_mended(study, mapmore):
    for setting, code, found in (
        ("data.columns.strain.scale=100", 3, "strain-in-per-cent"),
        ("fit.max_terms=30", 4, "short-segment"),
    ):
        many = ("--set", "dictionary.0.polynomial.order=20")
        wrong = mapmore("check", study, "--json", "--set", setting, *many, code=code, says=found)
        assert {issue["id"] for issue in json.loads(wrong.stdout)["issues"]} == {found}


def test_shipped_studies_are_clean_of_errors_and_warnings(document):
    for spec in sorted((PROJECT / "configs/m2").glob("*-static.yaml")):
        assert document("check", spec, "-q")["issues"] == [], spec


def test_a_measured_study_is_clean_of_errors_and_warnings(mapmore, measured_data):
    assert serious(mapmore, PROJECT / "configs/festo/festo_10mm_20cm_strain.yaml") == []


@pytest.mark.parametrize(
    ("paper", "study"), [("m1", "dmsp-20-88-m1-static"), ("m2", "dmsp-20-88-static")]
)
def test_the_settings_of_a_paper(tmp_path, mapmore, paper, study):
    """`--like` writes what `configs/` has for that paper, each key with a comment."""
    spec = tmp_path / "a.yaml"
    mapmore("init", PROJECT / "datasets/mckibben", "-o", spec, "--like", paper, code=0)
    drafted = load(spec).spec
    published = load(PROJECT / f"configs/{paper}" / f"{study}.yaml").spec
    for section in ("segment", "dictionary", "fuse"):
        assert getattr(drafted, section) == getattr(published, section)
    assert drafted.fit.max_terms == 1
    assert drafted.fit.tolerance == published.fit.tolerance
    lines = spec.read_text().splitlines()
    for key in ("segment:", "dictionary:", "fit:", "fuse:"):
        place = next(i for i, line in enumerate(lines) if line.startswith(key))
        assert "#" in lines[place] or "#" in lines[place - 1]
