"""The second component of load cycles: half the difference of their branches, where it is worth a model of its own (M1 IV.A)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.study.drafting.draft import Draft
from mapmore_cli.study.drafting.recordings import dataset_of
from mapmore_cli.study.inspection.evidence import HINGED, neighbourhood, slack_foot

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
    beside = _in_segments(draft.without("model", "validate"), curves)
    beside = replace(beside, spec={**beside.spec, "name": f"{draft.name[:LONGEST_NAME]}-hysteresis"})
    why = f"half the difference of the branches, {half / largest:.1%} of the largest force: the component that the static study leaves out"
    beside = beside.with_section("target", "hysteresis", why)
    return beside.with_section("validate", {"against": formulas}) if formulas else beside


def _in_segments(draft: Draft, curves: Sequence[Curve]) -> Draft:
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


COMPETITORS = ("sarosi", "polynomial_2", "polynomial_5", "muscle_like", "polynomial_3")
MOST_SEGMENTS = 4
SAMPLES_OF_A_SEGMENT = 12
FEWEST_ON_A_CURVE = 8
"""Samples, below which the curves of levels are one surface."""
CHOOSING_LEVELS = 4
"""Training levels, from which left-out ones choose a backbone."""


def with_model(draft: Draft, dataset: Dataset, inputs: Sequence[str]) -> Draft:
    """The draft with the sections from `segment` on."""
    swept = [name for name in inputs if name != dataset.level and name in dataset.quantities]
    levels = [int(curve.training.sum()) for curve in dataset.curves if curve.training.any()]
    if dataset.level is not None and min(levels) < FEWEST_ON_A_CURVE and len(swept) == 1:
        why = f"{min(levels)} samples on a curve: too few for a function of each, so that all are one surface"
        draft = draft.with_section("segment", {dataset.level: "none"}).noted(("segment", dataset.level), why)
        swept = [dataset.level, *swept]
    else:
        draft = _with_segments(draft, dataset, swept)
    draft = draft.with_section("dictionary", [{"polynomial": {"of": swept, "order": 3}}])
    turned = dataset.target != "force" and "force" in inputs
    known = [name for name in COMPETITORS if name in literature.names() and (turned or dataset.target == "force")]
    samples = sum(int(curve.training.sum()) for curve in dataset.curves)
    formulas = [name for name in known if _can_be_fitted(name, dataset, samples)]
    draft = _with_backbone(draft, dataset, formulas)
    draft = draft.with_section("fit", {"max_terms": 3, "stop": "bic"}, "up to three terms in each segment, as many as pay for themselves")
    if turned:
        why = f"the model of the {dataset.target} is inverted, so that scores are of the force, beside the formulas"
        return draft.with_section("validate", {"as": "force", "against": formulas}).noted(("validate", "as"), why)
    return draft.with_section("validate", {"against": formulas}) if formulas else draft


def _can_be_fitted(name: str, dataset: Dataset, samples: int) -> bool:
    """True where a formula finds its inputs, and more samples than it has parameters."""
    formula = literature.get(name)
    return {*formula.inputs} <= {*dataset.quantities} and len(formula.parameters) < samples


def _with_segments(draft: Draft, dataset: Dataset, swept: Sequence[str]) -> Draft:
    """As many segments as the samples allow: of every curve, or two along each input of one surface."""
    if len(swept) == 2 and sum(int(curve.training.sum()) for curve in dataset.curves) >= 4 * SAMPLES_OF_A_SEGMENT:
        cut = {"method": "even", "count": 2, "min_samples": SAMPLES_OF_A_SEGMENT}
        why = f"nothing was held: one surface, whose cells are joined until each holds {SAMPLES_OF_A_SEGMENT} samples"
        return draft.with_section("segment", dict.fromkeys(swept, cut)).noted(("segment", swept[0]), why)
    count = segment_count(dataset.curves, swept[0]) if len(swept) == 1 else 1
    if count == 1:
        return draft
    reason = None if count == MOST_SEGMENTS else f"more than {count} would leave fewer than {SAMPLES_OF_A_SEGMENT} samples in one"
    return draft.with_section("segment", {swept[0]: {"method": "even", "count": count}}).noted(("segment", swept[0]), reason)


def segment_count(curves: Sequence[Curve], name: str) -> int:
    """The most even segments, up to four, that leave at least twelve samples in each segment of every training curve."""
    training = [curve.columns[name][~curve.held_out] for curve in curves if not curve.held_out.all()]
    for count in range(MOST_SEGMENTS, 1, -1):
        if all(_fewest(values, count) >= SAMPLES_OF_A_SEGMENT for values in training):
            return count
    return 1


def _fewest(values: Array, count: int) -> int:
    """How many samples the emptiest of `count` even segments has."""
    return int(np.histogram(values, bins=np.linspace(values.min(), values.max(), count + 1))[0].min())


def _with_backbone(draft: Draft, dataset: Dataset, formulas: Sequence[str]) -> Draft:
    if "sarosi" not in formulas or dataset.target != "force":
        return draft
    pooled = dataset.level is None or draft.spec.get("segment", {}).get(dataset.level) == "none"
    if pooled or sum(curve.training.any() for curve in dataset.curves) >= CHOOSING_LEVELS:
        why = "the formula, or none, on which the pieces err least where training data are left out"
        return draft.with_section("model", {"type": "mapmore", "backbone": AUTO}, why)
    pressure, strain, force = (
        np.concatenate([curve.columns[name] for curve in dataset.curves]) for name in ("pressure", "strain", "force")
    )
    foot = slack_foot(pressure, strain, force)
    backbone, why = "sarosi", "the formula first, then pieces for what it leaves"
    if foot is not None:
        why = f"next to no force below {foot.threshold.min():.0f} to {foot.threshold.max():.0f} kPa, rising with strain: a slack foot"
        if HINGED in literature.names():
            backbone, why = HINGED, f"{why}, for which this formula has a hinge"
    return draft.with_section("model", {"type": "mapmore", "backbone": backbone}, why)
