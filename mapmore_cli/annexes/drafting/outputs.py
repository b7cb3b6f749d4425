"""Several outputs of one study: what their specs share, and the campaign that runs them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from mapmore_cli.annexes.drafting.draft import Draft, yaml_text


def as_files(drafts: Sequence[Draft], output: Path | None) -> dict[Path, tuple[str, Draft]]:
    """Return the text of every file, and the draft that it is of: a spec for each study; for a
    study of several outputs a campaign, a fragment with what its specs share, and a spec for each.

    The first file is `output` where that is given, and those beside it have its name.
    """
    files: dict[Path, tuple[str, Draft]] = {}
    studies: dict[str, list[Draft]] = {}
    for draft in drafts:
        studies.setdefault(draft.of or draft.name, []).append(draft)
    for name, own in studies.items():
        first = output or Path(f"{name}.yaml")
        if len(own) == 1:
            files[first] = own[0].text(), own[0]
        else:
            files |= _campaign(name, own, first)
    return files


def _campaign(name: str, own: Sequence[Draft], first: Path) -> dict[Path, tuple[str, Draft]]:
    shared = first.with_name(f"_{first.name}")
    common = _common([draft.spec for draft in own])
    specs = {
        first.with_name(f"{first.stem}{draft.name.removeprefix(name)}.yaml"): (
            replace(draft, spec={"extends": shared.name, **_beyond(draft.spec, common)}).text(),
            draft,
        )
        for draft in own
    }
    runs = [{"base": path.name} for path in specs]
    campaign = {"schema_version": 1, "campaign": name, "runs": runs}
    head = f"# Started by `mapmore init`: `mapmore batch {first}` runs all, with one page."
    what = "# What the specs of all outputs share."
    return {
        first: (yaml_text(campaign, {}, head), own[0]),
        shared: (yaml_text(common, own[0].notes, what), own[0]),
        **specs,
    }


def _common(specs: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the keys that all have alike, those of `data` and its columns one by one."""
    first, *others = specs
    common: dict[str, Any] = {}
    for key, value in first.items():
        if key in ("data", "columns", "units"):
            common[key] = _common([spec.get(key, {}) for spec in specs])
        elif all(key in one and one[key] == value for one in others):
            common[key] = value
    return common


def _beyond(spec: dict[str, Any], common: dict[str, Any]) -> dict[str, Any]:
    rest: dict[str, Any] = {}
    for key, value in spec.items():
        if key not in common:
            rest[key] = value
        elif value != common[key]:
            rest[key] = _beyond(value, common[key])
    return rest
