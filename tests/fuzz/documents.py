"""Documents of a run: whole ones, changed as trees or as text, then read and shown; beside the
results of a small study.

A changed `scores.json` is refused or read, and makes the run out of date. A changed `run.json` is
ignored with a warning, refused, or read; it never ends as an internal fault, and neither do the
next plan of the run, `show`, or a comparison.
"""

import json
import shutil
from contextlib import redirect_stdout, suppress
from functools import cache
from io import StringIO
from unittest.mock import patch

from driver import Fault, Target, changed_text, changed_tree, refused
from specs import STATIC, write_data

from mapmore_cli.cli.console import print_view
from mapmore_cli.cli.views import of_file
from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.pipeline.archive import find_model, freeze
from mapmore_cli.pipeline.runner import bring_up_to_date, explain
from mapmore_cli.storage import artefacts
from mapmore_cli.storage.artefacts import read_validation
from mapmore_cli.storage.run_record import load_origin
from mapmore_cli.storage.scores import read_scores, scores_beside
from mapmore_cli.study.loader import load

VALUES = (
    *(
        None,
        True,
        "",
        "x",
        "2.9",
        "\x1b[2J",
        "a" * 5000,
        "\ud800",
        [],
        {},
        [[]],
        {"a": {}},
        0,
        -1,
        1.5,
        1e308,
        10**400,
        2**63,
        -(10**30),
    ),
    *(
        float("nan"),
        float("inf"),
        float("-inf"),
        "../../etc/passwd",
        "/etc/passwd",
        "fit.h5",
        "ingest",
        "stages",
        "3.0",
        "99",
    ),
)
MARKS = '{}[]:,"\\ntrue0123456789eE+-. \n\x00é'


def text_of(whole, chance):
    """A document with one to three changes, or changed as text."""
    kind = chance.random()
    if kind < 0.15:
        return changed_text(whole, chance, MARKS)
    if kind < 0.18:
        return chance.choice(
            [
                "",
                "null",
                "[]",
                "{",
                "[" * 100_000,
                "1" * 5000,
                "{}",
                whole[: chance.randrange(len(whole))],
                whole * 2,
            ]
        )
    document = json.loads(whole)
    for _ in range(chance.choice([1, 1, 1, 2, 3])):
        changed_tree(document, chance, lambda _: chance.choice(VALUES), document)
    return json.dumps(document)


@cache
def study(folder):
    """A study of 40 rows that was run, and its documents."""
    write_data(folder)
    (folder / "study.yaml").write_text(STATIC)
    loaded = load(folder / "study.yaml")
    run_dir = bring_up_to_date(loaded, folder / "runs").run_dir
    freeze(run_dir, "old", folder / "archive")
    return loaded, {name: (run_dir / name).read_text() for name in ("run.json", "scores.json")}


unchanged = cache(read_validation)  # the validation of the study: no input changes it


@patch.object(artefacts, "read_validation", lambda path, *_: unchanged(path))
def attempt(chance, number, folder):
    """Change one of the documents, do what reads it, and put it back."""
    loaded, documents = study(folder)
    runs = folder / "runs"
    run_dir, name = runs / "static", chance.choice(sorted(documents))
    path = run_dir / name
    path.write_text(text_of(documents[name], chance), encoding="utf-8", errors="surrogatepass")
    told = []
    try:
        outcome = "read"
        try:
            for place in (path, run_dir):
                with redirect_stdout(StringIO()):
                    view = of_file(place, told.append, False)
                    print_view(view, False)
                    print_view(view, True)
        except MapmoreError as error:
            outcome = refused(error)
        if name == "scores.json":
            with suppress(MapmoreError):
                read_scores(path)
            scores_beside(run_dir / "model.h5")
            again = [
                stage for stage, why in explain(loaded, runs, warn=told.append) if why is not None
            ]
            if "validate" not in again and path.read_text(errors="replace") != documents[name]:
                raise Fault("changed scores are taken for those of the run")
            return f"scores {outcome}"
        load_origin(run_dir)
        with suppress(MapmoreError):
            explain(loaded, runs, warn=told.append)
        with suppress(MapmoreError):
            frozen = freeze(run_dir, "new", folder / "archive")
            if frozen.parent != folder / "archive":
                raise Fault(f"frozen as {frozen}")
            shutil.rmtree(frozen)
        with suppress(MapmoreError):
            find_model("static", runs, folder / "archive")
        return f"record {outcome}{', ignored with a warning' if told else ''}"
    finally:
        path.write_text(documents[name])


def warm(folder):
    study(folder)


PAST = (
    "scores read",
    "scores refused (exit 4)",
    "record read",
    "record refused (exit 4)",
    "record read, ignored with a warning",
)
TARGET = Target("documents", attempt, past=PAST, warm=warm)
