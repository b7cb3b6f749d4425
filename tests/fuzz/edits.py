"""A study that is edited and run again in the same folder: it ends as in a fresh folder."""

from __future__ import annotations

import json
import shutil

from driver import Fault, Target
from studies import swing

from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.pipeline.runner import bring_up_to_date, explain
from mapmore_cli.study.loader import load
from mapmore_cli.study.yaml_dumper import dump

EDITS = 4
"""How often a study is edited."""


def first_form(chance, place):
    """Three recordings, and a spec of one of the kinds of models."""
    for number in range(3):
        write_recording(chance, place, number)
    columns = {name: {"column": name} for name in ("pressure", "force")}
    columns["time"] = {"column": "t", "unit": "s"}
    data = {"files": ["r*.csv"], "columns": columns}
    report = {"figures": [], "formats": ["html", "csv"]}
    spec = {"name": "edited", "data": data, "target": {"column": "force"}, "report": report}
    return other_structure(chance, spec)


def write_recording(chance, place, number):
    rows = [",".join(f"{value:.5f}" for value in row) for row in swing(chance, 40, 0)]
    (place / f"r{number}.csv").write_text("\n".join(["t,pressure,force", *rows]) + "\n")


def other_structure(chance, spec):
    """A spec without a structure is searched."""
    for key in ("dictionary", "model", "fit"):
        spec.pop(key, None)
    x, y = (name for name in spec["data"]["columns"] if name != "time")
    structures = [
        {"model": {"type": "auto", "prefer": "short"}},
        {"dictionary": [{"polynomial": {"of": [x], "order": chance.randint(1, 3)}}]},
        {"dictionary": [{"lags": {"of": [x, y], "steps": [1], "order": 1}}]},
        {"dictionary": [{"slow": {"of": [x], "tau": [0.1]}}], "fit": {"max_terms": 2}},
    ]
    return spec | chance.choice(structures)


def other_name(chance, spec):
    """The pressure, or the force, gets another name."""
    columns = spec["data"]["columns"]
    old = next(iter(columns))
    new = chance.choice(sorted({"pressure", "force", "p1", "load", "length"} - {*columns}))
    text = json.dumps(spec).replace(f'"{old}"', f'"{new}"')
    again = json.loads(text)
    again["data"]["columns"][new]["column"] = columns[old]["column"]
    return again


def other_settings(chance, spec):
    """Whatever does not touch the structure."""
    rival = {"set": {"validate.simple": False}, "as": "again"}
    formula = {"name": "own", "expression": "a*b", "parameters": {"a": {}}}
    parts = [
        {"muscle": {"name": chance.choice("AB")}},
        {"units": {chance.choice(["time", "load"]): chance.choice(["ms", "s", "kN"])}},
        {"validate": {"against": chance.choice([[], ["polynomial_2"], [rival]])}},
        {"report": {"figures": [], "formats": chance.choice([["csv"], ["html", "csv", "tex"]])}},
        {"formulas": chance.choice([[], [formula]])},
        {"data": spec["data"] | {"split": chance.choice([{}, {"validate": {"last": 0.3}}])}},
        {"data": spec["data"] | {"resample": chance.choice([0.01, 0.02])}},
    ]
    return spec | chance.choice(parts)


def damaged(chance, run_dir):
    """Remove or cut off a file of the run, and return its name: a file that was changed stays, also
    if the next run has no such file.
    """
    files = sorted(path for path in run_dir.rglob("*") if path.is_file() and path.name != ".lock")
    if not files:
        return ""
    path = chance.choice(files)
    whole = path.read_bytes()
    path.unlink()
    if chance.random() < 0.5:
        path.write_bytes(whole[: len(whole) // 2])
    return path.relative_to(run_dir.parent).as_posix()


def outcome(folder):
    """What a run and its page are, by file; or why there is none."""
    runs = folder / "runs"
    try:
        run = bring_up_to_date(load(folder / "study.yaml"), runs)
    except MapmoreError as error:
        return str(error).replace(str(folder), ""), {}
    files = {
        path.relative_to(runs).as_posix(): path.read_bytes()
        for folder in runs.glob("edited*")
        for path in folder.rglob("*")
        if path.is_file() and path.name not in (".lock", "run.json")
    }
    return run.stages, files


def edited(chance, number, folder):
    """Edit a study, run it, and compare the folder with that of a first run."""
    place, fresh = folder / f"live{number}", folder / f"fresh{number}"
    place.mkdir()
    form, done, changed = first_form(chance, place), 0, set()
    for step in range(EDITS):
        (place / "study.yaml").write_text(dump(form))
        told = planned(place)
        stages, files = outcome(place)
        shutil.copytree(place, fresh, ignore=shutil.ignore_patterns("runs"))
        first, expected = outcome(fresh)
        shutil.rmtree(fresh)
        if expected and told != stages:
            raise Fault(f"step {step}: explained {told}, but did {stages}")
        if not expected and stages != first:
            raise Fault(f"step {step}: {stages}, but in a fresh folder {first}")
        files = {name: files[name] for name in files.keys() - (changed - expected.keys())}
        if expected and (wrong := differing(files, expected)):
            raise Fault(f"step {step}: not as in a fresh folder: {wrong}")
        if expected and {*outcome(place)[0].values()} != {"up-to-date"}:
            raise Fault(f"step {step}: a second run is not up to date")
        done += bool(expected)
        for edit in chance.sample([other_structure, other_name, other_settings], 2):
            form = edit(chance, form)
        if chance.random() < 0.3:
            write_recording(chance, place, chance.randrange(4))
        if chance.random() < 0.3:
            changed.add(damaged(chance, place / "runs" / "edited"))
    shutil.rmtree(place)
    return "done" if done else "refused"


def planned(folder):
    """What `--explain` says that a run would do."""
    try:
        reasons = explain(load(folder / "study.yaml"), folder / "runs")
    except MapmoreError as error:
        return str(error)
    return {stage: "done" if why else "up-to-date" for stage, why in reasons}


def differing(files, expected):
    """The files that are in one of two folders only, or differ, apart from times of a search."""
    return sorted(
        name
        for name in files.keys() | expected.keys()
        if files.get(name) != expected.get(name)
        and not (name in expected and name in files and is_timed(name, files))
    )


def is_timed(name, files):
    """Whether a file has the seconds that each structure of a search took."""
    timed = ("search.json", "report/index.html", "report/tables/search.csv")
    return "edited/search.json" in files and name.removeprefix("edited/") in timed


TARGET = Target("edits", edited, past=("done",), longest=300)
