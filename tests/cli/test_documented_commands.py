"""Every command that the documentation shows is one; those of the tutorial and of the pipelines are
run.
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
from page_tables import block_of

from mapmore_cli.cli.app import app

ROOT = Path(__file__).parents[2]
PAGES = (
    ROOT / "README.md",
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted(filter(Path.is_file, (ROOT / "docs" / "examples").iterdir())),
)
FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
COMMAND = re.compile(r"(?:\s*|\s*- run: |.*\$\()(mapmore .*)")


def commands(page):
    """The words of every command in the blocks of a page, or in a script, without `mapmore` and
    without what the shell does.
    """
    text = page.read_text(encoding="utf-8")
    lines = (
        [line for _, block in FENCE.findall(text) for line in block.splitlines()]
        if page.suffix == ".md"
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
]


def test_there_are_commands_to_look_at():
    assert len(EVERY) > 45
    assert {"docs/tutorial.md", "docs/campaigns.md", "docs/examples/ci.yaml"} <= {
        page for page, _ in EVERY
    }


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


@pytest.mark.usefixtures("fewer_families")
def test_the_tutorial_from_beginning_to_end(tmp_path, mapmore, monkeypatch):
    monkeypatch.chdir(tmp_path)
    spec = tmp_path / "muscle.yaml"
    for command in commands(ROOT / "docs" / "tutorial.md"):
        mapmore(*command, code=0)
        if command[0] in ("example", "simulate"):
            thin_out(tmp_path)
        if command[0] == "init":  # one figure a run is quicker than all
            spec.write_text(spec.read_text() + "report: {figures: [fit]}\n")
    report = tmp_path / "runs" / "bench-2026" / "report"
    assert (report / "tables" / "scores.tex").read_text().startswith("%")
    assert (tmp_path / "fig3.pdf").read_bytes().startswith(b"%PDF")
    assert any((report / "panels").glob("*.pdf"))
    assert any((tmp_path / "controller").glob("*.c"))


def thin_out(folder):
    """One sample in 20 of every recording, which is quicker."""
    for path in folder.glob("*/load_cycle_*.csv"):
        head, *rows = path.read_text().splitlines()
        if len(rows) > 1000:
            path.write_text("\n".join([head, *rows[::20]]) + "\n")


def spec_of_tutorial():
    return block_of(ROOT / "docs" / "tutorial.md")


def write_recordings(folder):
    """Three slow load cycles, the upper branch on the way back."""
    for pressure in (100, 200, 300):
        strain = np.concatenate(
            [
                np.linspace(0, 0.05 + 0.0004 * pressure, 300),
                np.linspace(0.05 + 0.0004 * pressure, 0, 300),
            ]
        )
        force = 2 * pressure * (1 - 3 * strain) ** 2 - 40 + 4 * np.repeat([-1, 1], 300)
        rows = [f"{pressure},{e:.5f},{f:.2f}" for e, f in zip(strain, force, strict=True)]
        (folder / f"muscle_{pressure}.csv").write_text("\n".join(["P_kPa,strain,force_N", *rows]))


@pytest.fixture(scope="module")
def workshop(tmp_path_factory, mapmore):
    """The study of the tutorial, run without figures and frozen, and a `mapmore` on the path of
    scripts.
    """
    folder = tmp_path_factory.mktemp("workshop")
    write_recordings(folder)
    (folder / "muscle.yaml").write_text(spec_of_tutorial() + "report: {figures: []}\n")
    for command in (
        ["run", folder / "muscle.yaml", "--runs", folder / "runs", "-q"],
        [
            "freeze",
            folder / "runs" / "my-muscle",
            "--tag",
            "spring",
            "--archive",
            folder / "archive",
        ],
    ):
        mapmore(*command, code=0)
    (folder / "table.csv").write_text("pressure,strain\n150,0.02\n250,0.05\n")
    (folder / "bin").mkdir()
    (folder / "bin" / "mapmore").write_text(
        f'#!/bin/sh\nexec "{sys.executable}" -m mapmore_cli "$@"\n'
    )
    (folder / "bin" / "mapmore").chmod(0o755)
    return folder


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
        (workshop / "specs" / f"{name}.yaml").write_text(
            spec_of_tutorial().replace("my-muscle", name).replace('["muscle_', '["../muscle_')
        )
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
    run_dir = workshop / "runs" / "my-muscle"
    assert (run_dir / "report" / "index.html").is_file()
    assert "polynomial_2" in (run_dir / "scores.csv").read_text()
    assert (workshop / "junit.xml").is_file()
    assert "mapmore" in (workshop / "summary.md").read_text()
