"""The table of docs/init-and-check.md: what `init` proposes for folders of measured data, without a word from a user, and what it gives.

`python docs/drafted_tables.py [FOLDER ...]` makes the rows of all folders in `MAPMORE_DATA` (by default `../shared/data`) anew, or those of
some. All of them take about ten minutes. Every draft is checked and run as it is: with its guesses, the `CHECK`s included.
"""

from __future__ import annotations

import math
import os
import sys
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

from mapmore_cli.domain.errors import DataError, MapmoreError
from mapmore_cli.domain.scores import OWN, deciding
from mapmore_cli.spec.loader import LoadedSpec, load
from mapmore_cli.stages.drafting.draft import Draft
from mapmore_cli.stages.drafting.start import start
from mapmore_cli.stages.inspection.lint import inspect
from mapmore_cli.stages.pipeline.runner import bring_up_to_date
from mapmore_cli.storage.artefacts import read_validation

PAGE = Path(__file__).parent / "init-and-check.md"
BEGIN, END = "<!-- made by python docs/drafted_tables.py -->", "<!-- end of the table -->"
HEAD = ("| folder | spec | target | held constant | marked `CHECK` | `check` | `run`: NRMSE |", "|---|---|---|---|---|---|---|")


def data_folder() -> Path:
    """Where the measured data lie."""
    return Path(os.environ.get("MAPMORE_DATA", Path(__file__).parents[2] / "shared" / "data"))


def rows_of(folder: Path) -> list[str]:
    """A row for each spec that `init` proposes for a folder, or one that says why there is none."""
    with TemporaryDirectory() as place:
        try:
            found = start(folder, Path(place))
        except DataError as refusal:
            return [f"| `{folder.name}` | - | {refusal.message.rpartition(': ')[2]} | - | - | - | - |"]
        return [f"| `{folder.name}` | {proposed(draft)} | {tried(draft, Path(place))} |" for draft in found.drafts]


def proposed(draft: Draft) -> str:
    """Name, target, levels and open questions of a draft."""
    target = draft.spec["target"]
    told = target if isinstance(target, str) else f"`{target['column']}`"
    memory = "products" in str(draft.spec["dictionary"])
    levels = draft.data.get("levels")
    held = f"{len(levels['at'])} levels of {levels['of']}" if levels else "nothing"
    return f"`{draft.name}` | {told}, {'with memory' if memory else 'without memory'} | {held} | {draft.text().count('CHECK: ')}"


def tried(draft: Draft, place: Path) -> str:
    """What `check` finds in a draft, and the error of the model that `run` makes of it."""
    path = place / f"{draft.name}.yaml"
    path.write_text(draft.text(), encoding="utf-8")
    loaded = load(path)
    return f"{_checked(loaded)} | {_run(loaded, place / 'runs')}"


def _checked(loaded: LoadedSpec) -> str:
    counts = Counter(issue.severity for issue in inspect(loaded).issues)
    told = [f"{counts[word]} {word}{'s' if counts[word] > 1 else ''}" for word in ("error", "warning", "hint") if counts[word]]
    return ", ".join(told) or "clean"


def _run(loaded: LoadedSpec, runs: Path) -> str:
    try:
        folder = bring_up_to_date(loaded, runs, "validate").run_dir
    except MapmoreError as fault:
        return f"refused: {fault.message}"
    row = next(score for score in deciding(read_validation(folder / "validate.h5").scores) if score.model == OWN)
    where = "held out" if row.split == "validate" else "training"
    return f"{100 * row.nrmse:.2g} % {where}" if math.isfinite(row.nrmse) else f"no finite error, {where}"


def table(old: str, rows: dict[str, list[str]]) -> str:
    """The table with the rows of some folders made anew, and those of the others as they were, by folder."""
    kept = [line for line in old.splitlines() if line.startswith("| `") and line.split("`")[1] not in rows]
    every = sorted([*kept, *(row for found in rows.values() for row in found)], key=lambda line: line.split("`")[1])
    return "\n".join([*HEAD, *every])


def page(text: str, rows: dict[str, list[str]]) -> str:
    """The page with its table made anew."""
    before, _, rest = text.partition(BEGIN)
    old, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n\n{table(old, rows)}\n\n{END}{after}"


if __name__ == "__main__":
    chosen = [data_folder() / name for name in sys.argv[1:]] or sorted(path for path in data_folder().iterdir() if path.is_dir())
    for folder in chosen:  # each as soon as it is made: the rest may take long
        found = {folder.name: rows_of(folder)}
        PAGE.write_text(page(PAGE.read_text(encoding="utf-8"), found), encoding="utf-8")
