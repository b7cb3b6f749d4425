"""What a static study is compared with, and the second component of its load cycles: half the difference of their branches (M1 IV.A)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.modelling import literature
from mapmore_cli.study.drafting.draft import Draft
from mapmore_cli.study.drafting.recordings import dataset_of
from mapmore_cli.study.inspection.evidence import neighbourhood

APART = 0.01  # of the largest force: root mean square of half the difference, from which it is worth a model
ONE_WAY = 0.5  # of that, which its mean is at least: noise has no side
LONGEST_NAME = 80
SEGMENTS = 4
ARCH = 2  # order of a polynomial that is one
COVERED = 0.5  # of the places that all curves reach, that each does


def hysteresis_beside(draft: Draft, folder: Path) -> Draft | None:
    """Return the study of the hysteresis that the load cycles of a static one show; None where there are none, or branches are one."""
    if draft.spec["target"] != "static" or "cycles" not in draft.data:
        return None
    curves = dataset_of(draft.data, folder, "force").curves
    largest = max(float(np.abs(curve.columns["force"]).max()) for curve in curves)
    halves = np.concatenate([curve.columns["hysteresis"] for curve in curves])
    half = float(np.sqrt(np.mean(halves**2)))
    if half < APART * largest or abs(float(halves.mean())) < ONE_WAY * half:
        return None
    formulas = [name for name in draft.spec.get("validate", {}).get("against", ()) if name.startswith("polynomial")]
    beside = _in_segments(draft.without("model", "validate", "segment", "dictionary", "fit", "fuse"), curves)
    beside = replace(beside, spec={**beside.spec, "name": f"{draft.name[:LONGEST_NAME]}-hysteresis"}, found=None)
    beside = beside.with_section("fit", {"max_terms": 3, "stop": "bic"}, "up to three terms, as many as pay for themselves")
    why = f"half the difference of the branches, {half / largest:.1%} of the largest force: the component that the static study leaves out"
    beside = beside.with_section("target", "hysteresis", why)
    return beside.with_section("validate", {"against": formulas}) if formulas else beside


def _in_segments(draft: Draft, curves: Sequence[Curve]) -> Draft:
    """One function of each curve, or one smooth surface where the loops at neighbouring levels do not tell of each other.

    It is not searched: what errs least on left-out blocks of loops, which are noisier than the force, erred more at other levels. Settled
    by leaving inner levels out of the loops of eight records, measured and simulated. One arch for
    each curve erred less than four segments, and a surface less than curves where these do not tell of each other, for it follows no single
    loop (alike on one record). Where curves reach to different places a surface is bent by what it has not seen.
    """
    over, of = draft.data["cycles"]["over"], draft.data["levels"]["of"]
    training = [curve for curve in curves if curve.training.any()]
    found = neighbourhood(training, over, "hysteresis")
    if found is None or found.tells or not _alike(training, over):
        terms = [{"polynomial": {"of": [over], "order": ARCH}}]
        return draft.with_section("dictionary", terms, "one arch for each curve: loops are noisier than the force")
    why = f"a loop hardly follows from those at the next levels ({found}): a smooth surface of all; were the cycles driven alike?"
    draft = draft.with_section("segment", {of: "none", over: {"method": "even", "count": SEGMENTS}}).noted(("segment", of), why, False)
    return draft.with_section("dictionary", [{"polynomial": {"of": [over, of], "order": ARCH}}])


def _alike(curves: Sequence[Curve], over: str) -> bool:
    """Return True where every curve reaches over most of what all of them do."""
    spans = [float(np.ptp(curve.columns[over])) for curve in curves]
    return min(spans) >= COVERED * float(np.ptp(np.concatenate([curve.columns[over] for curve in curves])))


COMPETITORS = ("sarosi", "polynomial_2", "polynomial_5", "muscle_like", "polynomial_3")


def with_comparison(draft: Draft, dataset: Dataset) -> Draft:
    """Return the draft with the formulas beside which its model is scored, and as a force where that was set."""
    turned = dataset.target != "force" and "force" in dataset.curves[0].columns
    if dataset.target != "force" and not turned:
        return draft
    samples = sum(int(curve.training.sum()) for curve in dataset.curves)
    formulas = [name for name in COMPETITORS if name in literature.names() and _can_be_fitted(name, dataset, samples)]
    if turned:
        why = f"the model of the {dataset.target} is inverted, so that scores are of the force, beside the formulas"
        return draft.with_section("validate", {"as": "force", "against": formulas}).noted(("validate", "as"), why)
    return draft.with_section("validate", {"against": formulas}) if formulas else draft


def _can_be_fitted(name: str, dataset: Dataset, samples: int) -> bool:
    """Return True where a formula finds its inputs, and more samples than it has parameters."""
    formula = literature.get(name)
    return {*formula.inputs} <= {*dataset.quantities} and len(formula.parameters) < samples
