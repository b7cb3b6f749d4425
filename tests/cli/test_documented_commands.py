"""Every command that the documentation shows is one. Those of README, of the front page,
cookbook, exports and pipelines are run as they stand, and so are the pieces of a spec.
"""

import os
import re
import shlex
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
import typer
import yaml
from common import process
from scipy.signal import lfilter

from mapmore_cli.cli.app import app

ROOT = Path(__file__).parents[2]
PAGES = (
    ROOT / "README.md",
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted(filter(Path.is_file, (ROOT / "docs" / "examples").iterdir())),
)
FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
INDENTED = re.compile(r"^    (mapmore .*[^\\])$", re.MULTILINE)
COMMAND = re.compile(r"(?:\s*|\s*- run: |.*\$\(|\$ (?:.*\| )?)(mapmore .*)")


def commands(page):
    """The words of every command in the blocks of a page, or in a script, without `mapmore` and
    without what the shell does.
    """
    return commands_in(page.read_text(encoding="utf-8"), page.suffix)


def commands_in(text, suffix=".md"):
    """The same in a text."""
    lines = (
        [
            line
            for name, block in FENCE.findall(text)
            for line in block.replace("\\\n", " ").splitlines()
            if name != "text" and (name != "console" or line.startswith("$ "))
        ]
        + INDENTED.findall(text)
        if suffix == ".md"
        else text.splitlines()
    )
    for line in lines:
        if found := COMMAND.fullmatch(line.replace("\t", " ")):
            yield words(found[1])


def words(command):
    """A line of a shell as arguments: without comment, pipe, redirection and command
    substitution.
    """
    lexer = shlex.shlex(command.rstrip(")"), posix=True, punctuation_chars="|<>;&")
    lexer.whitespace_split, lexer.commenters = True, "#"
    found = []
    for word in lexer:
        if word and set(word) <= set("|<>;&"):
            break
        found.append(word)
    return found[1:]


EXAMPLES = ROOT / "docs" / "examples"
EVERY = [
    (page.relative_to(ROOT).as_posix(), tuple(command))
    for page in PAGES
    for command in commands(page)
    if command != ["--version"]  # which ends the program before it looks at anything else
]


def test_there_are_commands_to_look_at():
    assert len(EVERY) > 45
    assert {"docs/first-model.md", "docs/examples/ci.yaml"} <= {page for page, _ in EVERY}


@pytest.mark.parametrize(
    ("page", "command"),
    EVERY,
    ids=[f"{page}: {' '.join(command)}"[:100] for page, command in EVERY],
)
def test_every_command_has_the_arguments_that_it_is_shown_with(page, command):
    group = typer.main.get_command(app)
    context = group.make_context("mapmore", list(command), resilient_parsing=False)
    name, found, rest = group.resolve_command(context, [*context._protected_args, *context.args])
    found.make_context(name, rest, parent=context)


def test_readme_and_the_front_page_begin_with_a_run_that_prints_what_they_show(mapmore):
    """Every line that a page shows as output is printed by the commands above it."""
    printed = ""
    for command in (["example", "muscle"], ["run", "muscle/study.yaml"]):
        printed += mapmore(*command, "--quiet", code=0).stdout
    targets = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    made, *_ = FENCE.findall((ROOT / "README.md").read_text(encoding="utf-8"))
    assert {line.split()[1] for line in made[1].splitlines()} == {"demo", "test"} <= targets
    for page, before in ((ROOT / "README.md", 1), (ROOT / "docs" / "index.md", 0)):
        fences = FENCE.findall(page.read_text(encoding="utf-8"))[before:]
        (_, first), (_, result), (_, sections) = fences[:3]
        assert first.splitlines() == [
            "pip install .",
            "mapmore example muscle",
            "mapmore run muscle/study.yaml",
        ]
        shown = [" ".join(line.split()) for line in result.splitlines() if set(line) - set("- .")]
        assert set(shown) <= {" ".join(line.split()) for line in printed.splitlines()}
        study = yaml.safe_load(Path("muscle/study.yaml").read_text(encoding="utf-8"))
        for name, section in yaml.safe_load(sections).items():
            ours = study[name]
            assert section == ours or section.items() <= ours.items(), name


SPEC = """schema_version: 1
name: muscle
data:
  files: ["cycle_*.csv"]
  columns: {time: {column: t, unit: s}, pressure: {column: P, unit: kPa}, strain: {column: eps},
    force: {column: F, unit: N}}
  cycles: {over: strain}
  levels: {of: pressure, at: auto}
  split: {validate: {pressure: [200 kPa]}}
target: static
segment: {strain: {method: even, count: 4}}
dictionary: [{polynomial: {of: [strain], order: 4}}]
validate: {against: [sarosi, polynomial_2]}
report: {figures: []}
"""
"""The study that the pages call `muscle`."""


def renamed(name):
    """The same by another name, in a folder beside the recordings."""
    return SPEC.replace("name: muscle", f"name: {name}").replace('["cycle_', '["../cycle_')


RECORD = """cycles: null, levels: null, split: {validate: {pressure: null, last: 0.3}}}
segment: null
dictionary: [{polynomial: {of: [strain, pressure], order: 2}}]
target: {column: force}
validate: null
"""
VALVE = "Valve and muscle in one unit"
GIVEN = {
    "Two pressures only": "data: {files: [cycle_100.csv, cycle_300.csv], split: null}",
    "A psi log beside a tester": f"data: {{columns: {{pressure: null}}, {RECORD}",
    "Gaps in a recording": f"data: {{files: [gap.csv], {RECORD}",
    "Both coordinates of a tip": "data: {cycles: null}\nvalidate: null",
    "Leave one out": "data: {split: {validate: null}}",
    VALVE: "data: {files: [valve.csv], columns: {strain: null, "
    f"force: null, input: {{column: u, unit: V}}}}, {RECORD}",
}
"""What the recipes of the cookbook take for granted of a spec."""


def write_recordings(folder):
    """Four load cycles at each pressure, and what recipes call by other names."""
    time = np.arange(0, 40, 0.05)
    strain = 0.05 * (1 - np.cos(2 * np.pi * time / 10))
    friction = 4 * np.sign(np.gradient(strain))
    told = np.repeat(np.random.default_rng(1).uniform(50, 200, len(time) // 20), 20)
    air = lfilter([0.1], [1, -0.9], told)
    late = np.append(time, time[-1] + 0.05) + 0.7
    tables = {
        "valve.csv": {"t": time, "P": air, "u": told / 50},
        "tester.csv": {"t": time, "strain_pct": 100 * strain, "N": 2 * air * (1 - 3 * strain) ** 2},
        "pressure.txt": {"ms": 1000 * late, "psi": np.append(air, air[-1]) / 6.894757},
    }
    for p in (100, 200, 300):
        force = 2 * p * (1 - 3 * strain) ** 2 - 40 - friction
        for day, shift in (("cycle", 0), ("monday", 0), ("tuesday", 5)):
            cycles = {"t": time, "P": p + 0 * time, "eps": strain, "F": force + shift}
            tables[f"{day}_{p}.csv"] = cycles
    tables["gap.csv"] = {key: np.delete(x, slice(300, 400)) for key, x in cycles.items()}
    for name, columns in tables.items():
        titles, rows = ",".join(columns), np.column_stack([*columns.values()])
        np.savetxt(folder / name, rows, "%.5f", ",", header=titles, comments="")


@pytest.fixture(scope="module")
def workshop(tmp_path_factory, mapmore):
    """The study `muscle`, run and frozen, and a `mapmore` on the path of scripts."""
    folder = tmp_path_factory.mktemp("workshop")
    write_recordings(folder)
    (folder / "muscle.yaml").write_text(SPEC)
    runs, archive = folder / "runs", folder / "archive"
    mapmore("run", folder / "muscle.yaml", "--runs", runs, "-q", code=0)
    mapmore("freeze", runs / "muscle", "--tag", "spring", "--archive", archive, code=0)
    shutil.copytree(runs / "muscle", runs / "force")
    (folder / "given.yaml").write_text("extends: muscle.yaml\n" + GIVEN[VALVE])
    valve = re.findall(r"```yaml\n(.*?)```", recipes()[VALVE], re.DOTALL)
    (folder / "valve.yaml").write_text("extends: given.yaml\n" + valve[0])
    mapmore("validate", folder / "valve.yaml", "--runs", runs, "--no-check", code=0)
    (folder / "table.csv").write_text("pressure,strain\n150,0.02\n250,0.05\n")
    (folder / "wanted.csv").write_text("force,strain\n100,0.02\n250,0.05\n")
    (folder / "bin").mkdir()
    (folder / "bin" / "mapmore").write_text(
        f'#!/bin/sh\nexec "{sys.executable}" -m mapmore_cli "$@"\n'
    )
    (folder / "bin" / "mapmore").chmod(0o755)
    return folder


def recipes():
    """The sections of the cookbook, by their questions."""
    text = (ROOT / "docs" / "cookbook.md").read_text(encoding="utf-8")
    return dict(section.split("\n", 1) for section in text.split("\n## ")[1:])


@pytest.mark.parametrize("question", recipes())
def test_a_recipe_runs_as_it_stands(question, workshop, mapmore, tmp_path):
    """Its pieces of a spec in `muscle.yaml`, its commands on what comes of it."""
    shutil.copytree(workshop, tmp_path, dirs_exist_ok=True)
    (tmp_path / "given.yaml").write_text("extends: muscle.yaml\n" + GIVEN.get(question, ""))
    text = recipes()[question]
    for number, (language, block) in enumerate(FENCE.findall(text)):
        if language == "yaml" and "expression:" in block:
            (tmp_path / block.split()[1]).write_text(block)
        elif language == "yaml":
            spec = tmp_path / f"piece-{number}.yaml"
            spec.write_text(f"extends: given.yaml\n{block}")
            for name in ("muscle", "pressure"):
                shutil.rmtree(tmp_path / "runs" / name, ignore_errors=True)
            mapmore("validate", spec, "--no-check", code=0)
        elif block.startswith("#!"):
            (tmp_path / "job").write_text(block)
            places = {"PATH": f"{tmp_path / 'bin'}{os.pathsep}{os.environ['PATH']}"}
            given = {**places, "PYTHONPATH": str(ROOT), "SLURM_ARRAY_TASK_ID": "0"}
            (tmp_path / "specs").mkdir()
            (tmp_path / "specs" / "one.yaml").write_text(renamed("one"))
            assert process("bash", "job", cwd=tmp_path, env=given).returncode == 0
    for command in () if "#!" in text else commands_in(text):
        mapmore(*command, code=0)


def test_the_page_of_exports_runs_as_it_stands(workshop, mapmore, tmp_path):
    """Each model file that a command names is that of the workshop or, by its name, that of the
    pressure.
    """
    for name in ("wanted.csv", "table.csv"):
        shutil.copy(workshop / name, tmp_path)
    for command in commands(ROOT / "docs" / "export.md"):
        for word in (word for word in command if word.endswith(".h5")):
            Path(word).parent.mkdir(parents=True, exist_ok=True)
            run = "pressure" if "pressure" in word else "muscle"
            shutil.copy(workshop / "runs" / run / "model.h5", word)
        mapmore(*command, code=0)


def run(folder, *command):
    """A command in the workshop's folder."""
    places = [str(folder / "bin"), str(Path(sys.executable).parent), os.environ["PATH"]]
    environment = {"PATH": os.pathsep.join(places), "PYTHONPATH": str(ROOT)}
    return process(*command, cwd=folder, env=environment)


def test_the_shell_pipeline(workshop):
    done = run(workshop, EXAMPLES / "pipeline.sh", "muscle.yaml", "table.csv")
    assert done.returncode == 0, done.stderr
    head, *rows = done.stdout.splitlines()
    assert head.startswith("pressure,strain,")
    assert len(rows) == 2
    assert "mapmore" in done.stderr
    assert "%" in done.stderr
    # ends where it fails
    assert run(workshop, EXAMPLES / "pipeline.sh", "nothing.yaml", "table.csv").returncode == 3


@pytest.mark.long  # the shell pipeline runs the same commands
@pytest.mark.skipif(shutil.which("make") is None, reason="there is no make on this machine")
def test_the_makefile_makes_what_is_missing_and_nothing_twice(workshop):
    done = run(workshop, "make", "-f", EXAMPLES / "Makefile")
    assert done.returncode == 0, done.stderr
    made = {path.name: path.stat().st_mtime_ns for path in (workshop / "out").iterdir()}
    assert set(made) == {"model.h5", "figure.pdf", "lookup.csv"}
    again = run(workshop, "make", "-f", EXAMPLES / "Makefile")
    assert again.returncode == 0, again.stderr
    assert {path.name: path.stat().st_mtime_ns for path in (workshop / "out").iterdir()} == made


@pytest.mark.skipif(shutil.which("snakemake") is None, reason="Snakemake is not installed")
def test_the_snakefile(workshop):
    (workshop / "specs").mkdir()
    for name in ("one", "two"):
        (workshop / "specs" / f"{name}.yaml").write_text(renamed(name))
    done = run(
        workshop,
        "snakemake",
        "--snakefile",
        EXAMPLES / "Snakefile",
        "--cores",
        "1",
        "--config",
        "specs=specs",
        "runs=snake",
    )
    assert done.returncode == 0, done.stderr
    head, *rows = (workshop / "snake" / "scores.csv").read_text().splitlines()
    assert head.startswith("run,model,")
    assert {row.split(",")[0] for row in rows} == {"one", "two"}


def test_the_steps_of_the_workflow(workshop, mapmore, monkeypatch):
    monkeypatch.chdir(workshop)
    workflow = yaml.safe_load((EXAMPLES / "ci.yaml").read_text())
    steps = [
        step["run"]
        for step in workflow["jobs"]["model"]["steps"]
        if step.get("run", "").startswith("mapmore ")
    ]
    assert [words(step)[0] for step in steps] == ["check", "run", "compare"]
    for step in steps:
        mapmore(*words(step), code=0)
    run_dir = workshop / "runs" / "muscle"
    assert (run_dir / "report" / "index.html").is_file()
    assert "polynomial_2" in (run_dir / "scores.csv").read_text()
    assert (workshop / "junit.xml").is_file()
    assert "mapmore" in (workshop / "summary.md").read_text()
