"""`run`, `batch` and `mm.fit` say what `check` says: errors end them, warnings are told each time,
and nothing is read for it twice.
"""

import json

import pytest
from cli_samples import options, page_of

from mapmore_cli.checking import applied
from mapmore_cli.pipeline.runner import bring_up_to_date
from mapmore_cli.study.loader import load

PER_CENT = ("--set", "data.columns.strain.scale=100")
SIGN = "its sign seems to be inverted"
TURNED = ("--set", "data.columns.force.scale=-1")


@pytest.mark.usefixtures("batch_here")
def test_an_error_of_check_ends_a_run_with_its_place_and_its_code(
    study, tmp_path, mapmore, document
):
    runs = tmp_path / "runs"
    for command in ("run", "segment", "fit", "batch", "run"):  # again and again
        ended = mapmore(command, study, *PER_CENT, code=3, says="probably in per cent")
        assert "bench.yaml:" in ended.stderr or command == "batch"
    assert [path.name for path in (runs / "bench").glob("*.h5")] == ["ingest.h5"]
    mapmore("ingest", study, *PER_CENT, code=0)
    told = document("run", study, *PER_CENT, "--no-check", "-q")["warnings"]
    assert ["per cent" in warning for warning in told] == [True]
    assert page_of().count('">strain reaches') == 1
    # what went on once is no permission
    mapmore("run", study, *PER_CENT, code=3, says="probably in per cent")


def test_warnings_are_told_each_time_and_data_are_not_read_again(
    study, tmp_path, mapmore, monkeypatch
):
    runs = tmp_path / "runs"
    first = mapmore("run", study, *TURNED, code=0)
    assert first.stderr.count(SIGN) == 1
    assert page_of().count(SIGN) == 1

    def refuse(*_, **__):
        raise AssertionError("an up-to-date run applies no rule")

    monkeypatch.setattr(applied, "issues_of", refuse)
    told = []
    bring_up_to_date(load(study, TURNED[1::2]), runs, warn=told.append)
    assert [SIGN in message for message in told] == [True]
    (runs / "bench" / "check.json").write_text("{")  # damaged: the rules are applied again
    with pytest.raises(AssertionError):
        bring_up_to_date(load(study, TURNED[1::2]), runs)


@pytest.mark.usefixtures("batch_here")
def test_a_batch_warns_of_every_run_once(study, mapmore):
    again = study.with_name("again.yaml")
    again.write_text(study.read_text().replace("name: bench", "name: again"))
    ended = mapmore("batch", study, again, "--jobs", "1", *TURNED, "--json", code=0)
    runs = json.loads(ended.stdout)["runs"]
    assert [sum(SIGN in warning for warning in run["warnings"]) for run in runs] == [1, 1]


def test_variations_repeat_no_warning(study, mapmore):
    against = "validate.against=[{as: other, set: {fit.max_terms: 1}}]"
    ended = mapmore("run", study, *TURNED, "--set", against, code=0)
    assert ended.stderr.count(SIGN) == 1


def test_what_made_levels_impossible_is_told(study, mapmore):
    by_strain = options(
        "data.columns.strain.scale=100",
        "data.levels={of: strain, at: [0.0123, 0.0527]}",
        "data.split={}",
        "segment={}",
    )
    mapmore("run", study, *by_strain, code=4, says="probably in per cent")
