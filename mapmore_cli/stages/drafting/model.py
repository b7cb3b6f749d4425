"""Which model is tried first: segments, terms, backbone, and what it is compared with."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.stages.drafting.draft import Draft
from mapmore_cli.stages.inspection.evidence import HINGED, slack_foot

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
