"""No output takes the place of a file that is still needed, and a file whose name mapmore chooses
takes the place of its own files alone.
"""

import shutil
from pathlib import Path

import pytest
import typer

from mapmore_cli.cli.app import app

MODEL = "runs/bench/model.h5"
GRID = "pressure=100:200:50,strain=0:0.04:0.02"
OUTPUTS = {
    ("run", "--summary"): [("run bench.yaml --summary", "bench.yaml")],
    ("run", "--junit"): [
        ("run bench.yaml --junit", "bench_200.csv"),
        ("run bench.yaml --set data.columns.force.column=Q --junit", "bench.yaml"),
    ],
    ("batch", "--junit"): [("batch sweep.yaml --jobs 1 --junit", "sweep.yaml")],
    ("batch", "--summary"): [
        ("batch sweep.yaml --jobs 1 --summary", "bench_100.csv"),
        ("batch broken.yaml --jobs 1 --summary", "bench_100.csv"),
    ],
    ("predict", "--output"): [
        (f"predict {MODEL} wanted.csv --delimiter , -o", "wanted.csv"),
        (f"predict {MODEL} wanted.csv --delimiter , -o", "hard.csv"),
        (f"predict {MODEL} wanted.csv --delimiter , -o", MODEL),
        (f"predict {MODEL} --grid {GRID} -o", "runs/bench/scores.csv"),
        (f"predict {MODEL} --grid {GRID} -o", "runs/bench/run.json"),
    ],
    ("invert", "--output"): [
        (f"invert {MODEL} forces.csv --delimiter , --for pressure -o", "forces.csv")
    ],
    ("figure", "--out"): [("figure bench fit -o", "final.svg")],
    ("figure", "--data"): [("figure bench fit --curve 200 -o new.svg --data", "bench_200.csv")],
    ("plan", "--output"): [("plan bench.yaml -o", "bench_300.csv")],
    ("tune", "--output"): [("tune bench.yaml --over fit.max_terms=1,2 -o", "bench_300.csv")],
    ("compare", "--figure"): [(f"compare {MODEL} {MODEL} --figure", "final.svg")],
    ("init", "--output"): [
        ("init bench_100.csv --yes --force -o", "bench_100.csv"),
        ("init bench_100.csv --yes --force -o", "bench_200.csv"),
    ],
    ("export", "--output"): [(f"export {MODEL} --to csv --grid {GRID} -o", "mine")],
}
"""What each option for an output may not replace, after the command that is called with it."""


@pytest.fixture(scope="module")
def start(tmp_path_factory, finished):
    folder = tmp_path_factory.mktemp("kept") / "start"
    spec, _ = finished
    shutil.copytree(spec.parent, folder)
    base = "base: bench.yaml, name: "
    (folder / "sweep.yaml").write_text(f"campaign: sweep\nruns: [{{{base}one}}]\n")
    broken = "set: {data.columns.force.column: Q}"
    (folder / "broken.yaml").write_text(f"campaign: broken\nruns: [{{{base}two, {broken}}}]\n")
    (folder / "wanted.csv").write_text("pressure,strain\n200,0.01\n")
    (folder / "forces.csv").write_text("force,strain\n200,0.01\n")
    (folder / "final.svg").write_text("final")
    (folder / "final.svg").chmod(0o444)
    (folder / "mine").mkdir()
    (folder / "mine/bench.csv").write_text("mine")
    return folder


def test_every_option_for_an_output_is_tried():
    commands = typer.main.get_command(app)
    context = typer.Context(commands)
    named = {
        (name, option.opts[0]): option.callback is not None
        for name in commands.list_commands(context)
        for option in commands.get_command(context, name).params
        if {"--output", "--out", "--junit", "--summary", "--figure", "--data"} & {*option.opts}
    }
    # test_cli_family has the family for `adapt`
    assert named.keys() == {*OUTPUTS, ("adapt", "--output")}
    # the names of exported files are not known before the model is read
    assert [option for option, refuses in named.items() if not refuses] == [("export", "--output")]


@pytest.mark.usefixtures("batch_here")
@pytest.mark.parametrize("option", OUTPUTS, ids=" ".join)
def test_no_output_replaces_a_file_that_is_needed(option, start, mapmore, monkeypatch, tmp_path):
    shutil.copytree(start, tmp_path / "here")
    monkeypatch.chdir(tmp_path / "here")
    Path("hard.csv").hardlink_to("wanted.csv")
    for line, kept in OUTPUTS[option]:
        place = Path(kept, "bench.csv") if Path(kept).is_dir() else Path(kept)
        before = files_here()
        again = ["--force"] if line.startswith(("run", "batch")) else []
        mapmore(*line.split(), kept, *again, code=7, says=(f"{place}: ", "replace"))
        assert files_here() == before, line


def test_an_export_that_may_not_be_written_is_refused_before_its_code_is_made(
    start, mapmore, monkeypatch
):
    monkeypatch.setattr("mapmore_cli.annexes.exporting.exports.exported", None)
    output = start / "mine"
    line = (start / MODEL, "--to", "csv", "--grid", GRID, "-o", output)
    mapmore("export", *map(str, line), code=7, says=f"{output / 'bench.csv'}: the file exists")


def files_here():
    """Return the files below the current folder with their contents and times."""
    files = [path for path in sorted(Path().rglob("*")) if path.is_file()]
    return {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in files}


# the output of `export` is a folder, which is made if necessary
LINES = [lines[0][0] for (command, _), lines in OUTPUTS.items() if command != "export"]


@pytest.mark.parametrize("line", [*LINES, "adapt model.h5 points.csv -o"])
def test_an_output_that_cannot_be_written_is_refused_before_anything_is_read(line, mapmore):
    """There is no spec, model or table in this folder, which would be another error."""
    Path("sealed.svg").write_text("")
    Path("sealed.svg").chmod(0o444)
    Path("link.svg").symlink_to("nowhere.svg")
    Path("folder.svg").mkdir()
    long = f"{'a' * 300}.svg"
    for output in ("no/such.svg", "sealed.svg", "link.svg", "folder.svg", "sealed.svg/a.svg", long):
        mapmore(*line.split(), output, code=7, says=output)
    assert [path.name for path in Path().iterdir() if path.name.startswith(".")] == []


@pytest.mark.parametrize(
    "line",
    [
        ("figure", "bench", "fit"),
        ("init", "bench_100.csv", "--yes", "-o", "fit.yaml", "--force"),
    ],
    ids=lambda line: line[0],
)
def test_a_default_name_replaces_no_file_of_the_user(line, copied, mapmore, monkeypatch):
    monkeypatch.chdir(copied[0].parent)
    for path in (Path("fit.svg"), Path("fit.html")):
        path.write_text("mine")
    mapmore(*line, "-q", code=7, says="not written by mapmore")
    assert Path("fit.svg").read_text() == Path("fit.html").read_text() == "mine"


def test_a_glob_of_everything_reads_the_same_recordings_again(copied, mapmore, monkeypatch):
    monkeypatch.chdir(copied[0].parent)
    line = ("run", "bench.yaml", "--set", "data.files=['**/*.csv']", "--figures", "none")
    mapmore(*line, "--force", "-q", code=0)
    before = [Path(f"runs/bench/{name}").read_bytes() for name in ("scores.csv", "model.h5")]
    told = mapmore(*line, "--force", code=0).stderr
    assert "no recordings are read in runs/bench, because results of mapmore lie there" in told
    assert [
        Path(f"runs/bench/{name}").read_bytes() for name in ("scores.csv", "model.h5")
    ] == before
