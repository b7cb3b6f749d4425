"""The second component of load cycles: half the difference of their branches, where it is worth a model of its own (M1 IV.A)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from mapmore_cli.stages.drafting.draft import Draft
from mapmore_cli.stages.drafting.recordings import dataset_of

APART = 0.01  # of the largest force: root mean square of half the difference, from which it is worth a model
ONE_WAY = 0.5  # of that, which its mean is at least: noise has no side
LONGEST_NAME = 80


def hysteresis_beside(draft: Draft, folder: Path) -> Draft | None:
    """The study of the hysteresis that the load cycles of a static one show; None where there are none, or their branches are one."""
    if draft.spec["target"] != "static" or "cycles" not in draft.data:
        return None
    curves = dataset_of(draft.data, folder, "force").curves
    largest = max(float(np.abs(curve.columns["force"]).max()) for curve in curves)
    halves = np.concatenate([curve.columns["hysteresis"] for curve in curves])
    half = float(np.sqrt(np.mean(halves**2)))
    if half < APART * largest or abs(float(halves.mean())) < ONE_WAY * half:
        return None
    formulas = [name for name in draft.spec.get("validate", {}).get("against", ()) if name.startswith("polynomial")]
    beside = draft.without("model", "validate")
    beside = replace(beside, spec={**beside.spec, "name": f"{draft.name[:LONGEST_NAME]}-hysteresis"})
    why = f"half the difference of the branches, {half / largest:.1%} of the largest force: the component that the static study leaves out"
    beside = beside.with_section("target", "hysteresis", why)
    return beside.with_section("validate", {"against": formulas}) if formulas else beside
