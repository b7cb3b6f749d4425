"""Try a draft with the rules of `check` before it is written; no model is fitted."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mapmore_cli.annexes.drafting.draft import Draft
from mapmore_cli.checking.applied import issues_of
from mapmore_cli.checking.findings import is_for_the_spec
from mapmore_cli.checking.rules.curves import FEWEST
from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.ingestion.dataset import build_dataset
from mapmore_cli.ingestion.files import slice_of
from mapmore_cli.study.loader import load_text
from mapmore_cli.study.yaml_loader import dump


def checked(draft: Draft, plainer: Sequence[Draft], folder: Path) -> Draft:
    """Return the draft if nothing is wrong with it; otherwise the first of the `plainer` drafts
    without an error; otherwise the draft with the error, which the user can correct in the spec,
    noted beside its target.

    Paths of all drafts start at `folder`. Raises DataError for an error that only other data can
    correct.
    """
    fault = _fault(draft, folder)
    if fault is None:
        return draft
    for other in plainer:
        if _fault(other, folder) is None:
            why = f"made simpler (no levels, and nothing is held out), since {fault.message}"
            return other.noted(("target",), why, sure=False)
    if isinstance(fault, SpecError):
        why = f"`check` finds an error: {fault.message}; {fault.remedy}"
        return draft.noted(("target",), why, sure=False)
    raise DataError(f"{draft.name}: {fault.message}", fault.remedy)


def _fault(draft: Draft, folder: Path) -> SpecError | DataError | None:
    """Return the error that would end `check` or the search for a structure: findings of the rules,
    or too few samples.
    """
    try:
        loaded = load_text(dump(draft.spec), "draft.yaml", folder)
        dataset = build_dataset(slice_of(loaded.spec), folder)
        issues = issues_of(loaded, dataset)
    except (SpecError, DataError) as fault:
        return fault
    errors = [issue for issue in issues if issue.severity == "error"]
    if errors:
        kind = SpecError if is_for_the_spec(errors) else DataError
        message = "; ".join(f"{issue.message} [{issue.id}]" for issue in errors)
        return kind(message, errors[0].remedy)
    most = max(int(np.count_nonzero(curve.training)) for curve in dataset.curves)
    if "dictionary" in draft.spec or most >= FEWEST:
        return None
    return DataError(
        f"no curve has more than {most} training samples, too few for the search of a structure",
        "measure more, or name terms in a `dictionary` by hand",
    )
