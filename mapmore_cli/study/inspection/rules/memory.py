"""Rules about recordings for terms with memory: it counts samples, and lasts no longer than these follow each other."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.memory.records import records_of, time_step
from mapmore_cli.study.inspection.rules import Issue, Subject


def even_steps(subject: Subject) -> Iterator[Issue]:
    """All recordings at the same even steps, and none with holes that nobody declared."""
    if not subject.spec.runs_over_time:
        return
    curves = subject.dataset.curves
    try:
        step = time_step(curves)
        records = records_of(curves, step)
    except DataError as fault:
        yield Issue("error", "uneven-steps", subject.where("data"), fault.message, fault.remedy or "", "data")
        return
    breaks = len(records) - sum(len(curve.logs) for curve in curves)
    if breaks > 0:
        middle = int(np.median([record.size for record in records]))
        gaps = f"{breaks} gap{'s' if breaks > 1 else ''}"
        message = f"memory begins anew at {gaps} within recordings: half of the pieces are of {middle} samples or less"
        remedy = f"add `resample: {step:.6g} s` to `data`, and `gaps: {{longer_than: ..., action: split}}` for those too long to fill"
        yield Issue("warning", "memory-breaks", subject.where("data"), message, remedy)
