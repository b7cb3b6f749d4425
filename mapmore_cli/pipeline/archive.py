"""Freeze models: copy them to folders that no later run overwrites. Compare frozen models with
later models.
"""

from __future__ import annotations

import errno
import json
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

from pydantic import ValidationError, create_model

from mapmore_cli import __version__
from mapmore_cli.domain.errors import DataError, UsageError, WriteError
from mapmore_cli.modelling.kinds import alone
from mapmore_cli.modelling.validation.comparison import Comparison, compare
from mapmore_cli.pipeline.differences import recorded, slice_differences
from mapmore_cli.pipeline.staleness import MODEL_STAGE
from mapmore_cli.storage.artefacts import read_model
from mapmore_cli.storage.atomic import (
    content_of,
    refusals_told,
    refuse_irregular,
    sync_tree,
    unfinished_beside,
    write_own,
)
from mapmore_cli.storage.run_folder import MODEL
from mapmore_cli.storage.run_record import (
    CAMPAIGN_RECORD,
    RUN_RECORD,
    SEARCH_STAGE,
    Origin,
    StageRecord,
    load_origin,
    load_records,
    refuse_stale,
    stale_stages,
)
from mapmore_cli.storage.stamps import take_stamp
from mapmore_cli.study.experiment import ExperimentSpec

KEPT = (MODEL, "scores.json", "scores.csv", "experiment.yaml", RUN_RECORD)
FROZEN = "frozen.json"
TAG = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")


def freeze(run_dir: Path, tag: str, archive: Path, campaign: str = "") -> Path:
    """Copy the model of a finished run, its scores, spec and hashes to `ARCHIVE/NAME@TAG`, and
    return this folder. `campaign` is the name of the campaign that is frozen, if it is one; the
    folder keeps this name, so that later the runs of the frozen campaign are known.

    Raises DataError if the run is not finished, its files were changed, or its record has no valid
    name; UsageError for an invalid tag; WriteError if the folder exists already or the archive
    cannot be written.
    """
    if not TAG.fullmatch(tag):
        raise UsageError(
            f"{tag!r} cannot be used as a tag",
            "use letters, digits, points, dashes and underscores, for example 2026-spring",
        )
    _check_finished(run_dir)
    name = _entry(run_dir / RUN_RECORD, "name")
    # the name becomes part of a path, so a name from a copied record could lead to any folder
    if not isinstance(name, str) or not TAG.fullmatch(name):
        raise DataError(
            f"{run_dir / RUN_RECORD}: does not contain the name of the run",
            "repeat the run with `mapmore run CONFIG --force`",
        )
    place = archive / f"{name}@{tag}"
    refuse_irregular(place)
    refusal = WriteError(
        f"{place}: this tag is frozen already, and a frozen model is never overwritten",
        "choose another tag",
    )
    with refusals_told(archive):
        archive.mkdir(parents=True, exist_ok=True)
        with unfinished_beside(place, folder=True) as unfinished:
            if place.exists():
                raise refusal
            for kept in KEPT:
                write_own(unfinished / kept, (run_dir / kept).read_bytes())
            _check_finished(unfinished)  # another process may have written the run meanwhile
            hashes = {kept: take_stamp(unfinished / kept).sha256 for kept in KEPT}
            document = {
                "creator": f"mapmore {__version__}",
                "name": name,
                "tag": tag,
                **({"campaign": campaign} if campaign else {}),
                "sha256": hashes,
            }
            write_own(
                unfinished / FROZEN, json.dumps(document, indent=1, ensure_ascii=False) + "\n"
            )
            for file in (*KEPT, FROZEN):
                (unfinished / file).chmod(0o444)  # read-only
            sync_tree(unfinished)
            unfinished.chmod(0o755)
            try:
                unfinished.rename(place)
            except OSError as fault:
                # another process may have created the folder in the meantime
                if fault.errno in (errno.ENOTEMPTY, errno.EEXIST):
                    raise refusal from fault
                raise
    return place


def _entry(path: Path, *keys: str) -> object:
    """Return the value in a JSON file that is found by following the `keys` from the outer object
    to the inner objects. Return None if there is no such value or no file.
    """
    try:
        entry = json.loads(content_of(path))
        for key in keys:
            entry = entry[key]
    except (OSError, ValueError, TypeError, KeyError, IndexError, RecursionError):
        return None
    return entry


def _check_finished(run_dir: Path) -> None:
    """Raise DataError if the folder lacks one of the files that are frozen, if the model or the
    scores were changed after the run wrote them, or if they are out of date.
    """
    remedy = "bring the run up to date with `mapmore run`"
    if missing := [kept for kept in KEPT if not (run_dir / kept).is_file()]:
        raise DataError(f"{run_dir}: is not a finished run ({', '.join(missing)} missing)", remedy)
    outputs = [record.outputs for record in load_records(run_dir).values()]
    written = {path: stamp.sha256 for stamps in outputs for path, stamp in stamps.items()}
    for kept in KEPT[:3]:
        if take_stamp(run_dir / kept).sha256 != written.get(kept):
            raise DataError(f"{run_dir / kept}: was changed after the run wrote it", remedy)
    refuse_stale(run_dir)


def find_model(text: str, runs: Path, archive: Path) -> Path:
    """Return the model file that `text`, an argument of a command, refers to. The text may be a
    file, a run folder, the name of a run, `NAME@TAG`, or a tag that only one run has.

    Raises DataError if there is none, or if a frozen model has been changed; UsageError if several
    runs have the tag.
    """
    path = Path(text)
    if path.is_file():
        return path
    tagged = sorted(archive.glob(f"[!.]*@{text}")) if TAG.fullmatch(text) else []
    places = [path, runs / text, archive / text, *tagged]
    folders = list(dict.fromkeys(place for place in places if (place / MODEL).is_file()))
    if not folders:
        raise DataError(
            f"{text}: there is no model with this name",
            f"name a model file, a run in {runs}, or a tag in {archive}",
        )
    if len(folders) > 1 and folders[0].parent == archive:
        names = ", ".join(place.name for place in folders)
        raise UsageError(
            f"{text}: several frozen models have this tag: {names}", "name one of them in full"
        )
    model, record = folders[0] / MODEL, folders[0] / FROZEN
    if record.is_file() and take_stamp(model).sha256 != _entry(record, "sha256", MODEL):
        raise DataError(
            f"{model}: was changed after it was frozen",
            "restore the folder from a backup, or freeze the run again",
        )
    return model


def runs_of(campaign: Path) -> list[str] | None:
    """Return the names of the runs of a campaign whose page is in the given folder; None if the
    folder has no such page.

    Raises DataError if the record of the campaign does not name its runs.
    """
    record = campaign / CAMPAIGN_RECORD
    if not record.is_file():
        return None
    names = _entry(record, "runs")
    if not isinstance(names, list) or not all(TAG.fullmatch(str(name)) for name in names):
        raise DataError(
            f"{record}: does not contain the names of the campaign's runs",
            "repeat it with `mapmore batch CAMPAIGN`",
        )
    return names


def find_campaign(text: str, runs: Path, archive: Path) -> dict[str, Path] | None:
    """Return the model file of each run of a campaign, by the name of the run. If `text` is
    `CAMPAIGN@TAG`, these are the models that were frozen with this tag. If `text` is only the name
    of a campaign, these are the models that the runs have now. Return None if there is no such
    campaign.

    A frozen campaign is found even if its runs have been removed. In archives of older versions,
    the frozen folders do not name their campaign; a frozen campaign then has the runs that it has
    now.
    """
    name, at, tag = text.partition("@")
    records = sorted(archive.glob(f"[!.]*@{tag}/{FROZEN}")) if TAG.fullmatch(tag) else []
    frozen = [record.parent for record in records if _entry(record, "campaign") == name]
    names = [folder.name.removesuffix(f"@{tag}") for folder in frozen] or runs_of(runs / name)
    if names is None:
        return None
    return {run: find_model(f"{run}{at}{tag}", runs, archive) for run in names}


def made_from(run_dir: Path) -> tuple[str, list[str]]:
    """Return the spec or the campaign from which a run was made. If it was made from a spec, also
    return those settings of the command line that affect the model.
    """
    origin = load_origin(run_dir) or Origin("")
    harmless = ("name=", "report", "validate")
    settings = [] if origin.campaign else origin.settings
    return origin.campaign or origin.spec, [o for o in settings if not o.startswith(harmless)]


def compared(
    before: Path, after: Path, margin: float, other_settings: bool, output: str = ""
) -> Comparison:
    """Compare two models, including the settings with which their runs were made. `output` selects
    one of several outputs.

    Raises UsageError if the settings differ, unless `other_settings` are allowed; DataError if the
    models predict different quantities or have too few curves in common.
    """
    records = [load_records(model.parent) for model in (before, after)]
    settings = tuple(_other_settings(*records))
    if settings and not other_settings:
        raise UsageError(
            f"{before} and {after} were made with different settings, which may cause the "
            f"difference: {'; '.join(settings)}",
            "make both with the same settings, or add --allow-other-settings",
        )
    # the recordings of a model that is out of date are unknown
    hashes = [
        {stamp.sha256 for stage in stages.values() for stamp in stage.inputs.values()}
        for stages in records
        if MODEL_STAGE not in stale_stages(stages)
    ]
    try:
        first, second = (alone(read_model(model).of(output)) for model in (before, after))
        comparison = compare(first, second, margin)
    except ValueError as fault:
        remedy = (
            "compare models of the same quantities that have curves in common; for other models, "
            "name the earlier model in `validate.against` of the later study"
        )
        raise DataError(f"{before}, {after}: {fault}", remedy) from fault
    return replace(
        comparison,
        settings=settings,
        same_recordings=len(hashes) == 2 and hashes[0] == hashes[1] != set(),
    )


MADE_BY = ("segment", "dictionary", "model", "fit", "fuse")
"""Sections of a spec that determine how a model is made from its curves."""


def _other_settings(*runs: Mapping[str, StageRecord]) -> Iterator[str]:
    """Yield the settings that differ between two runs: each key with its two values. Yield nothing
    if a model has no record of its run, or if both structures were found by searches with the same
    settings.

    If an older version did not have a key, the key is treated as if it had its default value.
    """
    sections = {name: ExperimentSpec.model_fields[name] for name in MADE_BY}
    keys = {name: (key.annotation, key.default) for name, key in sections.items()}
    made_by = create_model("MadeBy", **cast(dict[str, Any], keys))
    for stage in (SEARCH_STAGE, MODEL_STAGE):
        slices = [run[stage].slice for run in runs if stage in run]
        for place, values in enumerate(slices):
            known = {key: values[key] for key in MADE_BY if key in values}
            # a record of a newer version may have keys that are unknown here; its settings are then
            # compared as they are
            with suppress(ValidationError):
                known = recorded(made_by.model_validate_json(json.dumps(known)))
            slices[place] = known
        if len(slices) == 2:
            yield from slice_differences(stage, *slices)
            return
