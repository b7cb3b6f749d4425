"""From a group of recordings to a spec in which every guess says why."""

from __future__ import annotations

from pathlib import Path

from mapmore_cli.domain.errors import DataError
from mapmore_cli.stages.drafting.columns import guess_columns
from mapmore_cli.stages.drafting.draft import Draft
from mapmore_cli.stages.drafting.experiment_section import with_experiment
from mapmore_cli.stages.drafting.files_section import cleaned, constants_of, started, with_columns
from mapmore_cli.stages.drafting.groups import Group
from mapmore_cli.stages.drafting.model_section import with_model
from mapmore_cli.stages.drafting.readings import dataset_of, raw_columns

POSITIONS = ("strain", "displacement", "length")
"""Quantities that say how far a muscle has contracted, the most telling first."""


def propose(group: Group, name: str, folder: Path) -> Draft:
    """The spec of a group of recordings, with paths from `folder`.

    Raises
    ------
    DataError
        Where there is nothing to model: no pressure, or neither force nor displacement.
    """
    titles = dict(zip(group.layout.columns, group.layout.titles or (), strict=False))
    guesses = guess_columns(titles, raw_columns(group, folder))
    target = "force" if "force" in guesses else "displacement"
    position = next((one for one in POSITIONS if one in guesses), None) if target == "force" else None
    untold = next((one for one in ("pressure", position or "strain") if one not in guesses), "") if target == "force" else ""
    constants = constants_of(group, untold) if untold else None
    position = position or ("strain" if target == "force" and constants is not None and untold == "strain" else None)
    guesses = {one: guesses[one] for one in ("time", "pressure", position, target) if one in guesses}
    _refuse_unusable(group, target, {*guesses, *([untold] if constants else [])})
    draft = with_columns(started(group, name, folder, untold, constants), guesses, list(titles.values()))
    draft, dataset = cleaned(draft, folder, target)
    draft = with_experiment(draft, dataset.recordings, position)
    draft = draft.with_section("target", "static" if target == "force" else {"column": target})
    return with_model(draft, dataset_of(draft.data, folder, target), position)


def _refuse_unusable(group: Group, target: str, have: set[str]) -> None:
    missing = [one for one in ("pressure", target) if one not in have]
    if missing:
        told = ", ".join(group.layout.titles or ()) or f"{group.layout.width} columns without titles"
        what = " and no ".join("force or displacement" if one == target else one for one in missing)
        raise DataError(
            f"{group.files[0].name}: no {what} was recognised in {told}",
            "name the columns in a header, as pressure_kPa, strain, force_N, or write the spec by hand",
        )
