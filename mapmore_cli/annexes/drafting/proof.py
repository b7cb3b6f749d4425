"""The structure of a draft is searched on its training data; the model is then made in memory, and
scored as a run would score it.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mapmore_cli.annexes.drafting.draft import Draft, Note, Section
from mapmore_cli.annexes.search.searching import search
from mapmore_cli.annexes.search.stage import search_slice
from mapmore_cli.checking.evidence import two_digits
from mapmore_cli.domain.errors import DataError, MapmoreError
from mapmore_cli.domain.results import Search
from mapmore_cli.domain.scores import Score, deciding
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.pipeline.runner import bring_up_to_date
from mapmore_cli.storage.atomic import scratch_folder
from mapmore_cli.storage.run_folder import RunFiles
from mapmore_cli.study.loader import load_text
from mapmore_cli.study.yaml_loader import dump

if TYPE_CHECKING:
    from mapmore_cli.fitting.stage import Progress
    from mapmore_cli.study.loader import LoadedSpec

MODEL = ("segment", "dictionary", "model", "fit", "fuse")
EXPERIMENT = ("cycles", "keep", "derive", "split", "levels", "resample", "gaps")


def score_in_words(own: Score, plainer: Score | None) -> str:
    """Return the error of a draft in words, and that of a plainer model that errs less."""
    where = "on held-out data" if own.split == "validate" else "on its own training data"
    if not np.isfinite([own.rmse, own.nrmse]).all():
        return f"no finite error {where}"
    told = f"NRMSE {_per_cent(own)} {where}" + (", worse than their mean" if own.r2 <= 0 else "")
    if own.split != "validate" or plainer is None or plainer.rmse >= own.rmse:
        return told
    if _per_cent(plainer) == _per_cent(own):
        return told
    return f"{told}; {plainer.model} has {_per_cent(plainer)} there"


def _per_cent(score: Score) -> str:
    return f"{two_digits(100 * score.nrmse):g} %" if score.nrmse else "0 %"


def proven(
    draft: Draft, folder: Path, budget: float = 20.0, progress: Progress = lambda *_: None
) -> Draft:
    """Return the draft with the structure that a search finds, and what it scored. Where data are
    too few for it, it is a straight line of all of them, without levels.

    The search takes `budget` seconds of computing time of each process.
    Raises DataError where there is no model.
    """
    before = draft.notes.get(("target",), Note(""))
    simpler = ""
    try:
        made, told = _tried(draft, folder, budget, progress)
    except MapmoreError as fault:
        simpler = f"made simpler, as {' '.join(fault.message.split())[:160]}"
        try:
            made, told = _tried(_straight_line(draft), folder, budget, progress)
        except MapmoreError:
            raise DataError(f"{draft.name}: {fault.message}", "write the spec by hand") from fault
    return made.noted(
        ("target",),
        "; ".join(filter(None, (before.why, simpler, f"tried: {told}"))),
        before.sure and not simpler,
    )


def _straight_line(draft: Draft) -> Draft:
    """Return the draft of a line of the first input, with nothing held out or at a level."""
    entries = [entry for entry in draft.data["files"] if isinstance(entry, dict)]
    beside = [name for entry in entries for name in entry.get("set", {})]
    names = (*draft.data["columns"], *beside)
    first = next(name for name in names if name not in ("time", draft.output))
    line = [{"polynomial": {"of": [first], "order": 1}}]
    bare = draft.without("validate", *MODEL, *(f"data.{key}" for key in EXPERIMENT))
    return bare.with_section("dictionary", line)


def _tried(draft: Draft, folder: Path, budget: float, progress: Progress) -> tuple[Draft, str]:
    """Return the draft with a model, and what it scored on data that are read once; MapmoreError
    for what `run` or the search have against it.
    """
    with scratch_folder() as runs:
        if "dictionary" not in draft.spec:
            loaded = _loaded({**draft.spec, "model": {"type": AUTO, "budget": budget}}, folder)
            ingested = RunFiles(bring_up_to_date(loaded, runs, "ingest").run_dir).dataset()
            part = search_slice(loaded.spec)
            draft = _with_structure(draft, search(ingested, part, progress, beside=False))
        run_dir = bring_up_to_date(_loaded(draft.spec, folder), runs, "validate").run_dir
        own, *others = deciding(RunFiles(run_dir).validation().scores)
    known = [row for row in others if np.isfinite(row.rmse)]
    return draft, score_in_words(own, min(known, key=lambda row: row.rmse, default=None))


def _loaded(spec: Section, folder: Path) -> LoadedSpec:
    return load_text(dump(spec), "draft.yaml", folder)


def _with_structure(draft: Draft, found: Search) -> Draft:
    """Return the draft with the sections that a search has found, and how."""
    sections: Section = {}
    for key, value in found.found.sections.items():
        section, _, inner = key.partition(".")
        sections[section] = {**sections.get(section, {}), inner: value} if inner else value
    for key in (key for key in MODEL if sections.get(key)):
        draft = draft.with_section(key, sections[key])
    cut = f", {found.cut} more not for want of time (--budget)" if found.cut else ""
    place = next(key for key in ("dictionary", "model", "segment") if sections.get(key))
    return replace(
        draft.noted(
            (place,),
            f"found by search: {found.found.words}; of {len(found.tried)} structures{cut}, the "
            "simplest that errs as little as the best on left-out training data "
            f"({found.found.error:.2g} of the range)",
        ),
        found=found,
    )
