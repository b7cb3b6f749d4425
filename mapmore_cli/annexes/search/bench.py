"""Prepare the data with which all structures of a search are compared: training samples, and the
folds that are left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mapmore_cli.annexes.search.parts import Parts, parts_of
from mapmore_cli.annexes.search.samples import Folds, cut_short, pooled_samples, thinned
from mapmore_cli.annexes.search.situation import Situation
from mapmore_cli.annexes.search.stretches import held_run, stretches
from mapmore_cli.domain.arrays import Array, BoolArray, extremes
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.modelling.literature.backbone import pooled_training
from mapmore_cli.modelling.pieces.recipe import Fuse
from mapmore_cli.modelling.simple import polynomial_fit
from mapmore_cli.study.sections.data import Levels
from mapmore_cli.study.sections.model import ModelChoice
from mapmore_cli.study.sections.split import Holdout


@dataclass(frozen=True)
class Slice:
    """The settings of a study on which the result of a search depends."""

    levels: Levels | None
    model: ModelChoice
    fuse: Fuse
    lengths: Mapping[str, float | None]
    held_out: Holdout | None
    ignored: tuple[str, ...]
    by_level: bool

    def in_order(self, dataset: Dataset) -> bool:
        """Return True if the samples of each recording can be used in the order of time, so that a
        model can predict them one after the other.

        This needs four conditions: there is a time, held-out samples are not drawn at random, no
        level is left out, and `cycles` have not changed the order of the samples.
        """
        drawn = self.held_out is not None and self.held_out.fraction is not None
        known = dataset.quantities
        return "time" in known and "hysteresis" not in known and not (drawn or self.by_level)


@dataclass(frozen=True)
class Bench:
    """Data with which all structures are compared: training samples, and the folds that are left
    out.

    - `folds`: a mask for each fold, (n,), over the samples of all curves, curve after curve. The
      first `blocks` folds leave out stretches of curves, the others whole levels, whole recordings
      or their ends.
    - `weights`: weights of the folds, (f,), of which only the ratios matter.
    - `asks_parts`: True if most held-out samples of the study belong to whole levels, to whole
      recordings or to ends of recordings or inputs.
    - `study`: training samples and held-out samples, both evenly thinned. The outputs of the
      held-out samples are not used.
    """

    dataset: Dataset
    study: Dataset
    situation: Situation
    folds: Folds
    blocks: int
    weights: Array
    left_out: str
    parts_left_out: str
    part: Slice
    asks_parts: bool

    @classmethod
    def of(cls, training: Dataset, situation: Situation, part: Slice, study: Dataset) -> Bench:
        """Return a bench for a search: the training samples, and folds that resemble the held-out
        data of the `study`. Long recordings are shortened first. Raises DataError if no sample can
        be left out.
        """
        every = pooled_samples(study)
        run = held_run(every)
        training = cut_short(training, run, situation.step)
        samples = pooled_samples(training)
        left_out, folds = stretches(samples, situation, part.held_out, run)
        blocks = [fold for fold in folds if fold.any()]
        kinds = parts_of(samples, situation, every, part.by_level)
        inside = Parts(left_out, blocks, 0.0, 1 - sum(kind.weight for kind in kinds))
        weights = [kind.weight / len(kind.folds) for kind in (inside, *kinds) for _ in kind.folds]
        if not weights:
            raise DataError(
                "`model: {type: auto}` leaves out training samples, and there are too few of them",
                "loosen `data.keep`, hold out less, or add recordings",
            )
        return cls(
            training,
            thinned(study, every=True),
            situation,
            [fold for kind in (inside, *kinds) for fold in kind.folds],
            len(blocks),
            np.array(weights),
            left_out,
            " and ".join(
                f"each of {len(kind.folds)} {kind.words} ({kind.weight:.0%} of the weight)"
                for kind in kinds
            ),
            part,
            sum(kind.share for kind in kinds) > 1 / 2,
        )

    @property
    def masks(self) -> list[list[BoolArray]]:
        """For each fold, a list with one mask for every curve, which is True for the samples that
        the fold leaves out.
        """
        ends = np.cumsum([curve.size for curve in self.dataset.curves])[:-1]
        return [np.split(fold, ends) for fold in self.folds]

    @cached_property
    def range(self) -> tuple[float, float]:
        """Smallest and largest output that a model may reasonably predict. The range contains the
        measured outputs of the training data, and the outputs that a polynomial of order 1 predicts
        at all inputs of the study, because inputs outside the training data may have outputs
        outside the measured range.
        """
        plane = polynomial_fit(1, self.study, self.situation.inputs)
        measured = pooled_training(self.study.curves)[self.study.target]
        return extremes(np.concatenate([measured, *(plane.of_curves(self.study) if plane else ())]))
