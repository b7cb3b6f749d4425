"""Somebody else's package: the template adds its parts, and a broken one harms nothing."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from common import mapmore, process, rows_of

from mapmore_cli.annexes.search.candidate import offered_structures
from mapmore_cli.annexes.search.situation import Situation
from mapmore_cli.domain import plugins

TEMPLATE = Path(__file__).resolve().parents[1] / "docs" / "examples" / "plugin"

BROKEN = """
[mapmore.formulas]
f = broken
bent = bent
[mapmore.readers]
r = broken
odd = odd
stops = stops
ends = ends
late = late
[mapmore.operators]
o = broken
wrong = pathlib
zz = mapmore_template.operator
[mapmore.kinds]
k = broken
mapmore = pathlib
[mapmore.figures]
late = late
lazy = late:lazy
[mapmore.exports]
e = broken
c = shlex:quote
named = pathlib:Path
[mapmore.commands]
c = broken
run = broken
export = broken
loud = loud:loud
"""
ODD = """
import warnings
warnings.simplefilter("error")
raise type("Odd", (BaseException,), {})()
"""
LOUD = """
import atexit, os, sys
print("printed at import")
sys.stdout.reconfigure(encoding="utf-8")
sys.stdout.buffer.write(b"buffered at import\\n")
atexit.register(print, "printed at exit")
os.write(1, b"written at import\\n")
sys.__stdout__.flush()

def loud(as_json: bool = False):
    "Print a document."
    from mapmore_cli.cli.console import print_document
    print("printed at work")
    os.system("echo printed by a child")
    print_document({"loud": 1})

loud.__annotations__["as_json"] = __import__("mapmore_cli.cli.console").cli.console.AsJson
"""
BENT = """
from mapmore_cli.modelling.literature.formula import Formula
FORMULA = Formula("bent", "-", ("pressure",), ("a", "b"), "a*exp(b*pressure)")
"""
LATE = """
from types import ModuleType
from mapmore_cli.reporting.figures.drawing import Drawing, Layout, Panel
from mapmore_cli.storage.tables import Reader

def fail(*_):
    return 1/0

READER = Reader("late", fail, (".late",))
draw = fail
lazy = ModuleType("late")
lazy.draw = lambda _: [Drawing("lazy", "", (Panel("", fail, "x", ("y",)),), Layout())]
"""
FAULTS = """
operators  o      ZeroDivisionError
operators  wrong  no Operator
operators  zz     there is already a `washout`
formulas   f      ZeroDivisionError
formulas   bent   to `nonlinear`, because the derivative
readers    r      ZeroDivisionError
readers    odd    Odd
readers    stops  KeyboardInterrupt
readers    ends   SystemExit
kinds      k      ZeroDivisionError
kinds      mapmore  there is already a `mapmore`
figures    late   ZeroDivisionError
figures    lazy   ZeroDivisionError
"""
STUDY = """
schema_version: 1
name: study
data:
  files: [log.jsonl]
  reader: json_lines
  columns:
    time: {column: t, unit: s}
    pressure: {column: P, unit: kPa}
    strain: {column: eps}
    force: {column: F, unit: N}
  split: {validate: {last: 0.4}}
target: static
dictionary:
  - washout: {of: [pressure], tau: [500 ms]}
  - polynomial: {of: [pressure, strain], order: 3}
fit: {max_terms: 6}
validate: {against: [power_law], simple: false}
report: {figures: [scatter, late, lazy], formats: [html, svg]}
"""


def test_every_group_is_on_the_page_and_in_the_template():
    """But for two groups that only mapmore's own annexes use."""
    package = Path(plugins.__file__).parents[1]
    code = "".join(path.read_text("utf-8") for path in package.rglob("*.py"))
    used = {*re.findall(r'\b(?:parts|entry_points|plugins\.load)\(\s*"(\w+)"', code)}
    page = (TEMPLATE.parents[1] / "extend.md").read_text("utf-8")
    shown = {*re.findall(r"^\| `mapmore\.(\w+)`", page, re.MULTILINE)}
    assert used == shown | {"stages", "python"}
    assert all(f"`{group}`" in plugins.__doc__ for group in used)
    template = (TEMPLATE / "pyproject.toml").read_text("utf-8")
    assert {*re.findall(r'"mapmore\.(\w+)"\]', template)} == shown - {"kinds"}


def write_log(path):
    """A force of known terms, one of them a washout, written out by its difference equation."""
    time = np.arange(0, 40, 0.1)
    pressure = 150 + 100 * np.sign(np.sin(2 * np.pi * time / 9))
    strain, fast = 0.05 + 0.04 * np.sin(time), np.zeros_like(time)
    for k in range(1, len(time)):
        fast[k] = np.exp(-0.1 / 0.5) * (fast[k - 1] + pressure[k] - pressure[k - 1])
    force = 2 * pressure * (1 - strain) ** 2 + 5 + 0.3 * fast
    columns = {"t": time.round(3), "P": pressure, "eps": strain, "F": force}
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    path.write_text("\n".join(json.dumps(dict(zip(columns, row, strict=True))) for row in rows))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A study of the template's parts, and Python's path with the template and a broken package."""
    place = tmp_path_factory.mktemp("plugins")
    shutil.copytree(TEMPLATE, place / "template")
    pip = (sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-build-isolation")
    offline = ("--no-index", "--disable-pip-version-check", "--target")
    subprocess.run([*pip, *offline, place / "path", place / "template"], check=True)
    (place / "path" / "broken.py").write_text("1/0\n")
    (place / "path" / "bent.py").write_text(BENT)
    (place / "path" / "late.py").write_text(LATE)
    (place / "path" / "loud.py").write_text(LOUD)
    (place / "path" / "odd.py").write_text(ODD)
    (place / "path" / "stops.py").write_text("raise KeyboardInterrupt")
    (place / "path" / "ends.py").write_text(
        "import os, sys\nos.chdir('/')\nsys.stdout.close()\nraise SystemExit(3)"
    )
    # another package may have our name
    for name, points in {"zbroken": BROKEN, "mapmore": "[mapmore.commands]\nfit = broken"}.items():
        about = place / "path" / f"{name}-1.0.dist-info"
        about.mkdir()
        (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        (about / "entry_points.txt").write_text(points)
    write_log(place / "log.jsonl")
    (place / "study.yaml").write_text(STUDY)
    return place


def test_the_template_is_found_and_what_is_broken_is_named_and_left_out(folder):
    run = partial(mapmore, cwd=folder, env={"PYTHONPATH": str(folder / "path")}, timeout=120)
    finished = run("run", "study.yaml", "--json")
    assert finished.returncode == 0, finished.stderr
    scores = {(row["model"], row["split"]): row for row in json.loads(finished.stdout)["scores"]}
    assert scores["mapmore", "validate"]["nrmse"] < 1e-9
    assert 0.001 < scores["power_law", "validate"]["nrmse"] < 0.1
    assert (folder / "runs" / "study" / "report" / "scatter.svg").is_file()
    for group, name, why in rows_of(FAULTS):
        told = f"warning: plug-in `{name}` ({group}) of zbroken is left out: "
        (line,) = [line for line in finished.stderr.splitlines() if line.startswith(told)]
        assert why in line
    exported = run("export", "runs/study/model.h5", "--to", "json", "-o", "out", "-q")
    assert (exported.returncode, exported.stderr) == (0, "")
    written = folder / "out" / "study.json"
    text = written.read_text()
    (equation,) = json.loads(text)["equations"].values()
    assert "0.3*washout(pressure, 0.5)" in equation
    edited = text.replace("0.3", "0.4")
    written.write_text(edited)
    again = run("export", "runs/study/model.h5", "--to", "json", "-o", "out", "-q")
    assert (again.returncode, written.read_text()) == (7, edited)
    assert run("hello", "--name", "me").stdout == "hello, me\n"
    in_c = run("export", "runs/study/model.h5", "--to", "c", "-o", "out", "--no-verify")
    told = "plug-in `c` (exports) of zbroken is left out: ValueError: there is already a `c`"
    assert (in_c.returncode, told in in_c.stderr) == (0, True)
    assert "`named` (exports) of zbroken is left out: TypeError: its name is" in in_c.stderr
    assert "SPDX-License-Identifier" in (folder / "out" / "study.c").read_text()
    broken = run("c")
    assert broken.returncode == 2
    assert "`c` is not installed: broken cannot be imported" in broken.stderr
    (folder / "log.late").write_text("x")
    as_late = ("--set", "data.files=[log.late]", "--set", "data.reader=late")
    failed = run("ingest", "study.yaml", "-q", *as_late)
    assert failed.returncode == 1
    assert failed.stderr.startswith("error: the plug-in late failed: ZeroDivisionError")


def test_a_plug_in_replaces_no_command_and_prints_into_no_document(folder):
    run = partial(mapmore, cwd=folder, env={"PYTHONPATH": str(folder / "path")}, timeout=60)
    loud = run("loud", "--json")
    assert (loud.returncode, json.loads(loud.stdout)) == (0, {"loud": 1})
    for words in (
        "printed at import",
        "buffered at import",
        "written at import",
        "printed at work",
        "by a child",
        "exit",
    ):
        assert words in loud.stderr
    for name in ("run", "export"):
        assert loud.stderr.count(f"plug-in `{name}` (commands) of zbroken is left out: ") == 1
    for line in (("--no-plugins", "run", "--help"), ("export", "--help", "--no-plugins")):
        shown = run(*line)
        assert (shown.returncode, shown.stderr) == (0, "")
        assert shown.stdout.startswith("Usage: mapmore ")
    without = run("--no-plugins", "hello", "--name", "me")
    assert (without.returncode, "No such command" in without.stderr) == (2, True)


def test_the_test_of_the_template_passes(folder):
    script = "import test_operator; test_operator.test_a_washout_is_found()"
    path = {"PYTHONPATH": str(folder / "path")}
    finished = process(sys.executable, "-c", script, cwd=folder / "template", env=path)
    assert finished.returncode == 0, finished.stderr


def test_a_family_of_structures_is_offered_to_the_search(folder, monkeypatch):
    monkeypatch.syspath_prepend(folder / "path")
    for remembered in (plugins._installed, plugins.entry_points, plugins.load):
        monkeypatch.setattr(plugins, remembered.__name__, remembered.__wrapped__)
    (family,) = plugins.parts("families", Mapping)
    monkeypatch.undo()
    recording = Situation("force", ("pressure", "strain"), None, 500, 1, step=0.1, steps=500)
    (structure,) = offered_structures(family.value, recording)
    (product,) = structure.sections["dictionary"]
    washout = {"of": ["pressure", "strain"], "tau": [0.5, 2]}
    assert product["products"]["of"] == ["pressure", "strain", {"washout": washout}]


def test_an_interrupt_of_the_user_is_no_fault_of_a_plugin():
    with plugins.interrupts_of_user() as interrupts, pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)
    assert interrupts == [signal.SIGINT]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_what_a_plug_in_prints_is_written_to_stderr_at_once(capfd):
    with plugins.printing_to_stderr():
        assert sys.stdout.writable()
        sys.stdout.write("told")
        assert capfd.readouterr() == ("", "told")
        os.write(1, b"by a child")
        assert capfd.readouterr() == ("", "by a child")
    os.write(1, b"a result")
    assert capfd.readouterr() == ("a result", "")


def test_a_fault_is_blamed_on_the_plug_in_whose_function_took_part(monkeypatch):
    points = (SimpleNamespace(module="theirs.part"), SimpleNamespace(module="mapmore_cli.part"))
    monkeypatch.setattr(plugins, "_installed", lambda: points)
    for module, blamed in (("theirs.other", "theirs"), ("mapmore_cli.x", None), ("numpy", None)):
        names = {"__name__": module}
        exec("def work(): raise LookupError", names)
        with pytest.raises(LookupError) as caught:
            names["work"]()
        assert plugins.blamed(caught.value) == blamed


def test_extensions_are_in_the_order_of_their_names(monkeypatch):
    points = {name: (name, ord(name)) for name in "edbca"}
    monkeypatch.setattr(plugins, "entry_points", lambda _group: points)
    monkeypatch.setattr(plugins, "load", lambda _group, name: SimpleNamespace(LETTER=ord(name)))
    found = [(added.name, added.value) for added in plugins.parts("letters", int)]
    assert found == [(name, ord(name)) for name in "abcde"]


def test_without_other_packages_the_parts_of_mapmore_remain(monkeypatch):
    monkeypatch.setenv(plugins.NONE_OF_OTHERS, "1")
    points = plugins._installed.__wrapped__()
    assert {point.module.partition(".")[0] for point in points} == {"mapmore_cli"}
    assert {"mapmore.kinds", "mapmore.commands"} <= {point.group for point in points}
