"""Apply residual tests, which show whether a better model could explain a part of the errors
(Ljung, System Identification, 2nd ed., 1999, section 16.6).

If a model explains everything except noise, its residuals are correlated neither with their own
past nor with the inputs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from mapmore_cli.domain.arrays import (
    Array,
    BoolArray,
    IntArray,
    by_blocks,
    in_blocks,
    picked,
    row_by_row,
)
from mapmore_cli.domain.models import Model, Pieces
from mapmore_cli.domain.recording import Curve, Dataset, uncertainty_of
from mapmore_cli.domain.results import AUTOCORRELATION, ResidualTest
from mapmore_cli.domain.scores import OWN, Score
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.kinds import predict, runs_over_time
from mapmore_cli.modelling.literature.backbone import pooled_training
from mapmore_cli.modelling.signals.sampling import MANY, PART
from mapmore_cli.modelling.validation.coverage import share_outside
from mapmore_cli.modelling.validation.intervals import NORMAL
from mapmore_cli.modelling.validation.metrics import judged

LAGS = 25  # longest lag in samples; in short records, a shorter one is used
# The mean residual is tested in this number of parts of the range of an input. All parts have the
# same number of samples.
PARTS = 10


FEWEST = 20  # smallest number of samples for which residuals are tested


def residual_tests(
    model: Model, dataset: Dataset, predicted: Sequence[Array], order_by: str | None
) -> tuple[ResidualTest, ...]:
    """Return the autocorrelation of the residuals, and a test of the residuals with each input.
    Only the samples by which a model is judged (`metrics.judged`) are tested. The result is empty
    if no sequence of samples (see `_pieces`) has at least `FEWEST` samples, or if all residuals are
    equal. `predicted` holds the predictions of each curve. With `order_by`, samples are in the
    order of that quantity, and the mean residual is tested in parts of each input's range. Without
    `order_by`, samples are in the order of time, and the residuals are correlated with each input.
    """
    residuals: list[Array] = []
    columns: dict[str, list[Array]] = {quantity.name: [] for quantity in model.inputs}
    for curve, values, wanted in zip(dataset.curves, predicted, judged(dataset), strict=True):
        measured = curve.columns[dataset.target]
        for rows in _pieces(curve, wanted, order_by):
            piece = by_blocks(np.subtract, picked(values, rows), picked(measured, rows))
            if _finite([piece])[0]:
                residuals.append(piece)
                for name in columns.keys() & curve.columns.keys():
                    x = picked(curve.columns[name], rows)
                    # the level is constant within a curve; its measured changes are noise
                    held = name == dataset.level and curve.level is not None
                    columns[name].append(np.full(len(x), curve.level) if held else x)
    known, low, high = _finite(residuals)
    if max(map(len, residuals), default=0) < FEWEST or known < FEWEST or low == high:
        return ()
    tests = [autocorrelation(residuals)]
    for name, parts in columns.items():
        _, low, high = _finite(parts)
        varies = high - low > 1e-9 * abs(high)
        if sum(map(len, parts)) < sum(map(len, residuals)) or not varies:
            continue  # no test for an input that was not measured at all samples
        tests.append(
            cross_correlation(name, residuals, parts)
            if order_by is None
            else means_over(name, np.concatenate(residuals), np.concatenate(parts))
        )
    return tuple(tests)


def _pieces(
    curve: Curve, wanted: BoolArray, order_by: str | None
) -> Iterator[IntArray | BoolArray]:
    """Yield the wanted samples in the order in which they are tested. Without `order_by`, yield a
    mask, (n,), for each recording of the curve. With `order_by`, yield one array with the row
    numbers of the whole curve, in the order of this quantity. Of a long curve, only every k-th row
    is used.
    """
    if order_by is not None:
        every = 1 if curve.size <= PART else -(-curve.size // MANY)
        rows = np.arange(0, curve.size, every)
        rows = rows[wanted[rows]]
        yield rows[np.argsort(picked(curve.columns[order_by], rows), kind="stable")]
    elif curve.origin is None:
        yield wanted
    else:
        yield from (wanted & (curve.origin == number) for number in np.unique(curve.origin))


def _finite(parts: Sequence[Array]) -> tuple[int, float, float]:
    """Return the number of finite values in the columns, and the smallest and the largest of these
    values.
    """
    blocks = (x[np.isfinite(x)] for part in parts for (x,) in in_blocks(part))
    ends = [(len(x), float(x.min()), float(x.max())) for x in blocks if len(x)]
    n, low, high = zip(*ends, strict=True) if ends else ((0,), (0.0,), (0.0,))
    return sum(n), min(low), max(high)


def autocorrelation(residuals: Sequence[Array]) -> ResidualTest:
    """Return the autocorrelation `r_k = sum_t e_t e_(t+k) / sum_t e_t^2` of residuals minus their
    mean, over pieces that are contiguous in time or place.

    Each piece has one array in `residuals`, NaN for missing values. The bounds are `1.96/sqrt(n)`
    for n residuals in all pieces.
    """
    both_ways = cross_correlation(AUTOCORRELATION, residuals, residuals)
    half = len(both_ways.x) // 2
    x, values, bounds = (part[half:] for part in (both_ways.x, both_ways.values, both_ways.bounds))
    return ResidualTest(AUTOCORRELATION, x, values, bounds)


def cross_correlation(
    name: str, residuals: Sequence[Array], inputs: Sequence[Array]
) -> ResidualTest:
    """Return the cross-correlation `r_k = sum_t u_t e_(t+k) / sqrt(sum u^2 sum e^2)` of an input u
    and the residuals e, both minus their means. At a positive lag k, the input is k samples earlier
    than the residual.
    """
    pairs = list(zip(residuals, inputs, strict=True))
    count = 0
    means = np.zeros(2)
    for pair in pairs:
        for block in in_blocks(*pair):
            known = np.isfinite(block).all(axis=0)
            count += int(known.sum())
            means += [x[known].sum() for x in block]
    means /= max(count, 1)
    most = min(LAGS, max(map(len, residuals)) // 4)
    lags = np.arange(-most, most + 1)
    sums = np.zeros(2 * most + 1)
    squares = np.zeros(2)
    for pair in pairs:
        before = 0  # number of samples repeated from the previous block
        for block in in_blocks(*pair, overlap=most):
            centred = np.array(block) - means[:, None]
            known = np.where(np.isfinite(centred).all(axis=0), centred, 0.0)
            e, u = np.pad(known, ((0, 0), (most - before, 0)))
            own_e = e[most:]
            own_u = u[most:]
            before = most
            # sums for the lags at which the input is earlier than the residual
            later = np.correlate(u, own_e, "valid")[::-1]
            sums += np.append(np.correlate(e, own_u, "valid")[:-1], later)
            squares += [own_e @ own_e, own_u @ own_u]
    bound = NORMAL / np.sqrt(count)
    values = sums / np.sqrt(squares.prod())
    return ResidualTest(name, lags.astype(np.float64), values, np.full(len(lags), bound))


def means_over(name: str, residuals: Array, x: Array) -> ResidualTest:
    """Return the mean residual in parts of the range of an input x. If x has few different values,
    each value is a part; otherwise, there are `PARTS` parts with equal numbers of samples. The
    bounds are `1.96 s/sqrt(n_part)`, with the standard deviation s of all residuals.
    """
    known = np.isfinite(residuals) & np.isfinite(x)
    e, x = residuals[known], x[known]
    order = np.argsort(x, kind="stable")
    starts = np.flatnonzero(np.diff(x[order], prepend=np.nan) != 0)
    parts = np.split(order, starts[1:]) if len(starts) <= PARTS else np.array_split(order, PARTS)
    places = np.array([x[part].mean() for part in parts])
    values = np.array([e[part].mean() for part in parts])
    bounds = NORMAL * float(e.std()) / np.sqrt([len(part) for part in parts])
    return ResidualTest(name, places, values, bounds)


def explained_by_inputs(model: Model, dataset: Dataset) -> Iterator[str]:
    """Yield a sentence for each input of known uncertainty. It gives the fraction of the mean
    squared training residual that this uncertainty explains.

    An error of the input changes the output of the model by this error times the slope of the
    model. No fit can remove this change.
    """
    unsure = [
        quantity for quantity in model.inputs if uncertainty_of(quantity.name) in dataset.quantities
    ]
    if not unsure or runs_over_time(model):
        return
    columns = pooled_training(dataset.curves)
    left = columns[model.output.name] - predict(model, columns)
    for quantity in unsure:
        x, sigma = columns[quantity.name], columns[uncertainty_of(quantity.name)]
        up, down = (predict(model, {**columns, quantity.name: x + way * sigma}) for way in (1, -1))
        share = float(np.mean((up - down) ** 2)) / 4 / max(float(np.mean(left**2)), TINY)
        yield (
            f"{quantity.name}: its uncertainty, times the slope of the model, makes up "
            f"{100 * share:.3g} % of the squared error on the training data"
        )


TINY = float(np.finfo(np.float64).tiny)

SAME = 1e-9  # two predictions with a smaller relative difference are treated as equal
# A warning is given if a larger fraction of the held-out samples lies outside the training range.
MOSTLY = 0.5

ROWS = {"train": "training data", "validate": "held-out data"}


def alarms(
    model: Model, dataset: Dataset, predictions: Sequence[Array], scores: Sequence[Score]
) -> tuple[str, ...]:
    """Return warnings about the scores of the run's own model, one sentence for each. A reader must
    know them before the scores.

    `predictions` holds the predictions of the model for every curve of the dataset.
    """
    sentences = [
        sentence
        for row in scores
        if row.model == OWN and row.curve == "all"
        for sentence in _of_scores(row)
    ]
    others = {model.output.name, dataset.target, "time"}
    if {*dataset.quantities} - others and not {*model.input_names} - others:
        sentences.append(
            "no input was selected: the model is a constant, or uses its own past output only"
        )
    sentences += _bare(model, dataset.curves, predictions)
    outside = share_outside(model, dataset)
    if outside > MOSTLY:
        sentences.append(
            f"{100 * outside:.3g} % of the held-out samples lie outside the training range, so "
            "that the scores mainly say how well the model extrapolates"
        )
    return tuple(sentences)


def _of_scores(row: Score) -> Iterator[str]:
    where = ROWS[row.split]
    if not np.isfinite(row.rmse):
        yield f"the model has no finite error on the {where}, so that it is useless"
        return
    r2 = round(row.r2, 9) + 0.0  # rounded, because R² of the mean value may differ from 0 slightly
    if r2 <= 0:
        comparison = "no better than" if r2 == 0 else "worse than"
        yield (
            f"R² on the {where} is {r2:.3g}: the model is {comparison} the mean of the measured "
            "values"
        )
    if row.max_abs_error_fs > 1:
        yield (
            f"the largest error on the {where} is {row.max_abs_error_fs:.3g} times the full "
            f"scale ({row.normaliser_name})"
        )


def _bare(model: Model, curves: Sequence[Curve], predictions: Sequence[Array]) -> Iterator[str]:
    """Yield a sentence if the output of the model is that of its backbone, so that the segments
    have no effect.
    """
    body = model.body
    if not isinstance(body, Pieces) or body.backbone is None:
        return
    formula = literature.of(body.backbone)
    same = f"the model equals its backbone {formula.name}"
    if not body.segments:
        yield (
            f"{same}, because its segments made the prediction of left-out training data "
            "worse and were removed"
        )
        return
    says = partial(formula.predict, body.backbone.parameters)
    alone = [row_by_row(says, curve.columns) for curve in curves]
    _, low, high = _finite(alone)
    near = SAME * max(-low, high)
    if all(
        np.allclose(ours, its, rtol=SAME, atol=near, equal_nan=True)
        for pair in zip(predictions, alone, strict=True)
        for ours, its in in_blocks(*pair)
    ):
        yield f"{same} on every sample, because its segments add nothing"
