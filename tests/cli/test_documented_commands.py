"""Every command that the documentation shows is one. Those of README and of the front page are run
as they stand, and so are the scripts in docs/examples.
"""

import os
import re
import shlex
import shutil
import sys
from pathlib import Path

import pytest
import typer
import yaml
from common import process

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
def test_every_command_has_the_arguments_that_it_is_shown_with(page, command, monkeypatch):
    # the folders of outputs do not exist here
    monkeypatch.setattr("mapmore_cli.storage.outputs.refuse_early", lambda *_, **_chosen: None)
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


@pytest.fixture(scope="module")
def workshop(tmp_path_factory, mapmore):
    """The example study as `muscle.yaml`, run and frozen, and `mapmore` on the path of scripts."""
    folder = tmp_path_factory.mktemp("workshop")
    runs, archive = folder / "runs", folder / "archive"
    mapmore("example", folder / "muscle", "-q", code=0)
    (folder / "muscle.yaml").write_text(spec_named("muscle"))
    mapmore("run", folder / "muscle.yaml", "--runs", runs, "-q", code=0)
    mapmore("freeze", runs / "muscle", "--tag", "spring", "--archive", archive, code=0)
    (folder / "table.csv").write_text("pressure,strain\n150,0.02\n250,0.05\n")
    (folder / "bin").mkdir()
    (folder / "bin" / "mapmore").write_text(
        f'#!/bin/sh\nexec "{sys.executable}" -m mapmore_cli "$@"\n'
    )
    (folder / "bin" / "mapmore").chmod(0o755)
    return folder


def spec_named(name, above=""):
    """The example study by another name, without figures."""
    return f"extends: {above}muscle/study.yaml\nname: {name}\nreport: {{figures: []}}\n"


@pytest.mark.long  # the shell pipeline runs the same command
def test_the_script_for_slurm(workshop, tmp_path):
    """One task of the job array does its spec."""
    text = (ROOT / "docs" / "many.md").read_text(encoding="utf-8")
    (job,) = (block for _, block in FENCE.findall(text) if "#SBATCH" in block)
    shutil.copytree(workshop / "muscle", tmp_path / "muscle")
    (tmp_path / "specs").mkdir()
    (tmp_path / "specs" / "one.yaml").write_text(spec_named("one", "../"))
    (tmp_path / "job").write_text(job)
    places = {"PATH": f"{workshop / 'bin'}{os.pathsep}{os.environ['PATH']}"}
    environment = {**places, "PYTHONPATH": str(ROOT), "SLURM_ARRAY_TASK_ID": "0"}
    assert process("bash", "job", cwd=tmp_path, env=environment).returncode == 0
    assert (tmp_path / "runs" / "one" / "model.h5").is_file()


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
