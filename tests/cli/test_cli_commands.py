"""`check`, `schema` and `batch`."""

import ast
import json
import re
from inspect import getsource, signature
from textwrap import dedent

import pytest
from cli_samples import write_study

from mapmore_cli.cli.app import MODULES, ORDER, _function
from mapmore_cli.domain.plugins import entry_points
from mapmore_cli.study.schema import json_schema


def test_every_command_has_a_place_in_the_order_of_the_work():
    assert sorted(ORDER) == sorted({*MODULES, *entry_points("commands")})


@pytest.mark.parametrize("name", ORDER)
def test_every_option_is_used(name):
    function = _function(name)
    nodes = ast.walk(ast.parse(dedent(getsource(function))))
    read = {node.id for node in nodes if isinstance(node, ast.Name)}
    assert {*signature(function).parameters} - read == set()


@pytest.mark.parametrize("name", ORDER)
def test_no_switch_is_on_unless_it_is_given(name):
    defaults = (parameter.default for parameter in signature(_function(name)).parameters.values())
    assert not any(default is True for default in defaults)


def test_check_says_what_was_found_and_writes_nothing(study, document, mapmore):
    before = sorted(study.parent.rglob("*"))
    found = document("check", study, "-q")
    assert found["name"] == "bench"
    assert [(r["rows_read"], r["rows_kept"]) for r in found["recordings"]] == [(40, 40)] * 3
    assert [(c["id"], c["train"], c["validate"]) for c in found["curves"]] == [
        ("pressure=100", 40, 0),
        ("pressure=200", 0, 40),
        ("pressure=300", 40, 0),
    ]
    assert "Rows of every recording" in mapmore("check", study).stdout
    assert sorted(study.parent.rglob("*")) == before


def test_check_of_wrong_data_and_of_a_wrong_spec(study, mapmore):
    with (study.parent / "bench_200.csv").open("a") as file:
        file.write("200,0.1,much\n")
    assert mapmore("check", study, code=4, says=["bench_200.csv", "row 42"]).stdout == ""
    study.write_text(study.read_text().replace("dictionary", "dictionery"))
    assert mapmore("check", study, code=3, says="bench.yaml:10:1").stdout == ""


def test_warnings_go_to_stderr_and_quiet_silences_them(study, mapmore):
    arguments = ("check", study, "--set", "data.levels.at=[100, 200]")
    assert "warning: bench_300.csv" in mapmore(*arguments).stderr
    assert mapmore(*arguments, "-q").stderr == ""


def test_the_schema_and_references(mapmore):
    assert json.loads(mapmore("schema").stdout) == json_schema()
    for what, line in (
        ("keys", "| `max_terms` |"),
        ("formulas", "### sarosi_hinged"),
        ("files", "### SegmentFit"),
    ):
        assert line in mapmore("schema", what).stdout


def test_batch_goes_on_after_a_failure_and_ends_with_the_highest_code(tmp_path, shell):
    good, broken = write_study(tmp_path, "good"), write_study(tmp_path, "broken")
    (tmp_path / "broken_200.csv").write_text("")
    options = ("--jobs", 2, "--summary", "s.md")
    done = shell("batch", broken, good, "none.yaml", *options, cwd=tmp_path)
    assert done.returncode == 4
    assert re.search(r"^good +\d+\.\d", done.stdout, re.MULTILINE)
    assert re.search(r"^none +failed", done.stdout, re.MULTILINE)
    assert "page: runs/good/report/index.html\n" in done.stdout
    *_, of_good, of_none = done.stdout.splitlines()
    assert of_good.startswith("good: ")
    assert of_none == "none: failed: error: none.yaml: no such file or directory"
    assert all(words in done.stderr for words in ("broken_200.csv", "none.yaml", "good: done"))
    assert "Traceback" not in done.stderr
    assert "1 of 3 runs in order" in (tmp_path / "s.md").read_text()


@pytest.mark.usefixtures("batch_here")
def test_batch_has_one_document_in_the_order_of_the_specs(tmp_path, mapmore):
    specs = [write_study(tmp_path, name) for name in ("b", "a")]
    override = ("--set", "validate.require.nrmse=1e-9", "--set", "report.formats=[csv]")
    done = mapmore("batch", *specs, "--json", "-q", *override, code=6)
    runs = json.loads(done.stdout)["runs"]
    assert [run["name"] for run in runs] == ["b", "a"]
    assert all(run["exit_code"] == 6 and run["scores"] and len(run["missed"]) == 1 for run in runs)
    assert all(
        line.startswith(("a: error: nrmse", "b: error: nrmse")) for line in done.stderr.splitlines()
    )


@pytest.mark.usefixtures("batch_here")
def test_batch_says_of_a_run_that_nothing_was_done(copied, mapmore):
    spec, runs = copied
    result = mapmore("batch", spec, "--runs", runs, "--no-pages", code=0)
    assert "bench: up to date (1 of 1)" in result.stderr
    result = mapmore("batch", spec, "--runs", runs, "--no-pages", "--force", code=0)
    assert "bench: done (1 of 1)" in result.stderr
