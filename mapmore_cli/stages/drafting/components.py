"""The second component of load cycles: half the difference of their branches, where it is worth a model of its own (M1 IV.A)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mapmore_cli.domain.recording import Curve
from mapmore_cli.stages.drafting.draft import Draft
from mapmore_cli.stages.drafting.recordings import dataset_of
from mapmore_cli.stages.inspection.evidence import neighbourhood

APART = 0.01  # of the largest force: root mean square of half the difference, from which it is worth a model
ONE_WAY = 0.5  # of that, which its mean is at least: noise has no side
LONGEST_NAME = 80
SEGMENTS = 4
ARCH = 2  # order of a polynomial that is one
COVERED = 0.5  # of the places that all curves reach, that each does


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
    beside = _with_segments(draft.without("model", "validate"), curves)
    beside = replace(beside, spec={**beside.spec, "name": f"{draft.name[:LONGEST_NAME]}-hysteresis"})
    why = f"half the difference of the branches, {half / largest:.1%} of the largest force: the component that the static study leaves out"
    beside = beside.with_section("target", "hysteresis", why)
    return beside.with_section("validate", {"against": formulas}) if formulas else beside


def _with_segments(draft: Draft, curves: Sequence[Curve]) -> Draft:
    """One function of each curve, or one smooth surface where the loops at neighbouring levels do not tell of each other.

    Settled by leaving inner levels out of the loops of eight records, measured and simulated: they are noisier than the force. One arch for
    each curve erred less than four segments, and a surface less than curves where these do not tell of each other, for it follows no single
    loop (alike on one record). Where curves reach to different places a surface is bent by what it has not seen.
    """
    over, of = draft.data["cycles"]["over"], draft.data["levels"]["of"]
    training = [curve for curve in curves if curve.training.any()]
    found = neighbourhood(training, over, "hysteresis")
    if found is None or found.tells or not _alike(training, over):
        terms = [{"polynomial": {"of": [over], "order": ARCH}}]
        return draft.without("segment").with_section("dictionary", terms, "one arch for each curve: loops are noisier than the force")
    why = f"a loop hardly follows from those at the next levels ({found}): a smooth surface of all; were the cycles driven alike?"
    draft = draft.with_section("segment", {of: "none", over: {"method": "even", "count": SEGMENTS}}).noted(("segment", of), why, False)
    return draft.with_section("dictionary", [{"polynomial": {"of": [over, of], "order": ARCH}}])


def _alike(curves: Sequence[Curve], over: str) -> bool:
    """True where every curve reaches over most of what all of them do."""
    spans = [float(np.ptp(curve.columns[over])) for curve in curves]
    return min(spans) >= COVERED * float(np.ptp(np.concatenate([curve.columns[over] for curve in curves])))
