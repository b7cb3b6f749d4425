"""A small study with fake stages: text files, made from slices of a real spec and from the files
before.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import yaml

from mapmore_cli.fitting.stage import Stage
from mapmore_cli.study.experiment import ExperimentSpec


@dataclass(frozen=True)
class Study:
    """What the runner wants to know of a loaded spec."""

    spec: ExperimentSpec
    folder: Path
    overrides: tuple[str, ...] = ()
    tables: tuple[()] = ()  # no recordings in memory
    file: str = "study.yaml"

    @property
    def path(self):
        return self.folder / self.file

    @cached_property
    def resolved(self):
        return yaml.safe_dump(self.spec.model_dump(mode="json", by_alias=True))

    def resolved_in(self, _folder, **_form):
        return self.resolved


def study(folder, **sections):
    """A spec in `folder`, with sections replaced."""
    columns = {"strain": {"column": "e"}, "force": {"column": "F", "unit": "N"}}
    data = {
        "files": ["data/*.csv"],
        "columns": columns,
        "levels": {"of": "pressure", "at": [80.0, 250.0]},
    }
    document = {
        "name": "demo",
        "data": data,
        "target": "static",
        "dictionary": [{"terms": ["strain"]}],
        **sections,
    }
    return Study(ExperimentSpec.model_validate(document), folder)


def sources(_spec, folder):
    return sorted((folder / "data").glob("*.csv"))


def fake_stages(
    hook=lambda _step: None,
    revisions=None,
    runs=None,
):
    """Four stages, the last one with a folder as output; `runs` collects the names of those that
    run.
    """

    def write(path, text):
        with path.open("w") as file:
            file.write(text[: len(text) // 2])
            file.flush()
            hook(f"half of {path.name}")
            file.write(text[len(text) // 2 :])

    def started(name):
        hook(f"start of {name}")
        if runs is not None:
            runs.append(name)

    def ingest(part, workspace):
        started("ingest")
        rows = [path.read_text() for path in sources(None, workspace.spec_dir)]
        write(workspace.out / "ingest.h5", json.dumps([part["data"].model_dump(mode="json"), rows]))

    def fit(part, workspace):
        started("fit")
        write(
            workspace.out / "fit.h5",
            f"fit {part['fit'].max_terms} of {(workspace.run_dir / 'ingest.h5').read_text()}",
        )
        write(workspace.out / "terms.csv", "term\nstrain\n")

    def fuse(part, workspace):
        started("fuse")
        write(
            workspace.out / "model.h5",
            f"fused {part['fuse'].z_s} of {(workspace.run_dir / 'fit.h5').read_text()}",
        )

    def report(part, workspace):
        started("report")
        page = workspace.out / "report"
        (page / "tables").mkdir(parents=True)
        model, spec = (workspace.run_dir / "model.h5").read_text(), workspace.spec_text
        write(page / "index.html", f"<p>{part['report'].formats} {model}</p><pre>{spec}</pre>")
        write(page / "tables" / "scores.csv", "model\n")

    outputs = {ingest: ("ingest.h5",), fit: ("fit.h5", "terms.csv"), fuse: ("model.h5",)}
    keys = {ingest: ["data"], fit: ["dictionary", "fit"], fuse: ["fuse"], report: ["report"]}

    def stage(work):
        name = work.__name__
        return Stage(
            name,
            (revisions or {}).get(name, 1),
            outputs.get(work, (name,)),
            lambda spec: {key: getattr(spec, key) for key in keys[work]},
            work,
            sources if work is ingest else lambda _spec, _folder: (),
        )

    return tuple(map(stage, keys))


def make_data(folder):
    """Two recordings."""
    (folder / "data").mkdir()
    for name in ("a", "b"):
        (folder / "data" / f"{name}.csv").write_text(f"e,F\n0,{name}\n")


def contents(run_dir):
    """Every visible file of a run, but for `run.json`."""
    files = (path for path in run_dir.rglob("*") if path.is_file() and path.name != "run.json")
    relative = {path.relative_to(run_dir): path for path in files}
    return {
        name.as_posix(): path.read_text()
        for name, path in sorted(relative.items())
        if not name.parts[0].startswith(".")
    }
