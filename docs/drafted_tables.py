"""The table of docs/init-and-check.md: what `init` proposes for every folder of measured data, without a word from a user.

`python docs/drafted_tables.py` makes it anew, in about five minutes, from the folders in `MAPMORE_DATA` (by default `../shared/data`).
Every spec of the table has passed its own check, and of short recordings its own fit: `init` tries each before it hands it out.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from mapmore_cli.domain.errors import DataError
from mapmore_cli.stages.drafting.draft import Draft
from mapmore_cli.stages.drafting.start import start

PAGE = Path(__file__).parent / "init-and-check.md"
BEGIN, END = "<!-- made by python docs/drafted_tables.py -->", "<!-- end of the table -->"


def data_folder() -> Path:
    """Where the measured data lie."""
    return Path(os.environ.get("MAPMORE_DATA", Path(__file__).parents[2] / "shared" / "data"))


def rows_of(folder: Path) -> list[str]:
    """A row for each spec that `init` proposes for a folder, or one that says why there is none."""
    try:
        found = start(folder, Path())
    except DataError as refusal:
        return [f"| `{folder.name}` | - | {refusal.message.rpartition(': ')[2]} | - | - |"]
    return [f"| `{folder.name}` | {_row(draft)} |" for draft in found.drafts]


def _row(draft: Draft) -> str:
    target = draft.spec["target"]
    told = target if isinstance(target, str) else f"`{target['column']}`"
    memory = "products" in str(draft.spec["dictionary"])
    levels = draft.data.get("levels")
    held = f"{len(levels['at'])} levels of {levels['of']}" if levels else "nothing"
    return f"`{draft.name}` | {told}, {'with memory' if memory else 'without memory'} | {held} | {draft.text().count('CHECK: ')}"


def table(folders: list[Path]) -> str:
    """The table over some folders."""
    head = ["| folder | spec | target | held constant | marked `CHECK` |", "|---|---|---|---|---|"]
    return "\n".join([*head, *(row for folder in folders for row in rows_of(folder))])


def page(text: str, made: str) -> str:
    """The page with its table made anew."""
    before, _, rest = text.partition(BEGIN)
    return f"{before}{BEGIN}\n\n{made}\n\n{END}{rest.partition(END)[2]}"


if __name__ == "__main__":
    chosen = [data_folder() / name for name in sys.argv[1:]] or sorted(path for path in data_folder().iterdir() if path.is_dir())
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8"), table(chosen)), encoding="utf-8")
