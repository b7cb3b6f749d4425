"""Which model is tried first: segments, terms, backbone, and what it is compared with."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.modelling import literature
from mapmore_cli.stages.drafting.draft import Draft
from mapmore_cli.stages.inspection.evidence import HINGED, slack_foot

COMPETITORS = ("sarosi", "polynomial_2", "polynomial_5", "muscle_like", "polynomial_3")
MOST_SEGMENTS = 4
SAMPLES_OF_A_SEGMENT = 12


def with_model(draft: Draft, dataset: Dataset, inputs: Sequence[str]) -> Draft:
    """The draft with the sections from `segment` on."""
    swept = [name for name in inputs if name != dataset.level and name in dataset.quantities]
    count = segment_count(dataset.curves, swept[0]) if len(swept) == 1 else 1
    if count > 1:
        why = None if count == MOST_SEGMENTS else f"more than {count} would leave fewer than {SAMPLES_OF_A_SEGMENT} samples in one"
        draft = draft.with_section("segment", {swept[0]: {"method": "even", "count": count}}).noted(("segment", swept[0]), why)
    draft = draft.with_section("dictionary", [{"polynomial": {"of": swept, "order": 3}}])
    known = [name for name in COMPETITORS if name in literature.names() and dataset.target == "force"]
    formulas = [name for name in known if {*literature.get(name).inputs} <= {*dataset.quantities}]
    draft = _with_backbone(draft, dataset, formulas)
    draft = draft.with_section("fit", {"max_terms": 3, "stop": "bic"}, "up to three terms in each segment, as many as pay for themselves")
    return draft.with_section("validate", {"against": formulas}) if formulas else draft


def segment_count(curves: Sequence[Curve], name: str) -> int:
    """The most even segments, up to four, that leave at least twelve samples in each segment of every training curve."""
    training = [curve.columns[name][~curve.held_out] for curve in curves if not curve.held_out.all()]
    for count in range(MOST_SEGMENTS, 1, -1):
        if all(np.histogram(values, bins=count)[0].min() >= SAMPLES_OF_A_SEGMENT for values in training):
            return count
    return 1


def _with_backbone(draft: Draft, dataset: Dataset, formulas: Sequence[str]) -> Draft:
    if "sarosi" not in formulas or dataset.target != "force":
        return draft
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
