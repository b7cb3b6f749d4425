"""Write the specs of several outputs of one study, the part that these specs share, and the
campaign that runs them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from mapmore_cli.annexes.drafting.draft import Draft, Section, yaml_text

Files = dict[Path, tuple[str, Draft]]
"""The text of every file that is written, and the draft to which it belongs, by path."""


def as_files(drafts: Sequence[Draft], output: Path | None) -> Files:
    """Return the text of every file, and the draft to which the file belongs. A study of one output
    gets a spec. A study of several outputs gets a campaign, a file with the common part of its
    specs, and a spec for each output.

    If `output` is given, it is the first file, and the names of the other files begin with its
    name.
    """
    files: Files = {}
    studies: dict[str, list[Draft]] = {}
    for draft in drafts:
        studies.setdefault(draft.of or draft.name, []).append(draft)
    for name, outputs in studies.items():
        first = output or Path(f"{name}.yaml")
        if len(outputs) == 1:
            files[first] = outputs[0].text(), outputs[0]
        else:
            files |= _campaign(name, outputs, first)
    return files


def _campaign(name: str, outputs: Sequence[Draft], first: Path) -> Files:
    shared = first.with_name(f"_{first.name}")
    common, rests = _shared([draft.spec for draft in outputs])
    specs = {
        first.with_name(f"{first.stem}{draft.name.removeprefix(name)}.yaml"): (
            replace(draft, spec={"extends": shared.name, **rest}).text(),
            draft,
        )
        for draft, rest in zip(outputs, rests, strict=True)
    }
    runs = [{"base": path.name} for path in specs]
    campaign = {"schema_version": 1, "campaign": name, "runs": runs}
    head = (
        f"# Started by `mapmore init`: `mapmore batch {first}` runs all specs and writes one page."
    )
    shared_head = (
        "# The settings that the specs of all outputs share. For one model of all outputs with "
        "the same terms, write `target: [a, b]` and the columns of all outputs in one spec."
    )
    return {
        first: (yaml_text(campaign, {}, head), outputs[0]),
        shared: (yaml_text(common, outputs[0].notes, shared_head), outputs[0]),
        **specs,
    }


def _shared(specs: Sequence[Section]) -> tuple[Section, list[Section]]:
    """Return the section that all specs have in common and, for each spec, its remaining keys. In
    `data`, `columns` and `units`, the keys are compared one by one.
    """
    common: Section = {}
    rests: list[Section] = [{} for _ in specs]
    for key in {key: None for spec in specs for key in spec}:
        values: list[Any] = [spec.get(key) for spec in specs]
        if all(value == values[0] for value in values):
            common[key] = values[0]
            continue
        if key in ("data", "columns", "units"):
            common[key], values[:] = _shared([value or {} for value in values])
        for rest, value in zip(rests, values, strict=True):
            if value:
                rest[key] = value
    return common, rests
