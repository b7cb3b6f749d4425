"""Choose the scaling and the terms of one segment, and fit their coefficients."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from mapmore_cli.domain.arrays import (
    LONG,
    WIDE,
    Array,
    Columns,
    IntArray,
    columns_at,
    extremes,
    give_back,
    row_blocks,
)
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import (
    Scaling,
    Segment,
    SegmentFit,
)
from mapmore_cli.domain.recording import uncertainty_of
from mapmore_cli.modelling.expressions import (
    Expression,
    NotFinite,
    dictionary_block,
    dictionary_matrix,
    parse,
)
from mapmore_cli.modelling.expressions.ranged import placed
from mapmore_cli.modelling.expressions.syntax import names_in
from mapmore_cli.modelling.frols import TIE_TOLERANCE, Regression
from mapmore_cli.modelling.frols.correlated import MOST
from mapmore_cli.modelling.frols.engine import choose, choose_together, reads_once
from mapmore_cli.modelling.frols.select import Stopping
from mapmore_cli.modelling.frols.weighing import (
    FREEDOM,
    LARGEST_TUNING,
    SHORT,
    Choice,
    Weighing,
    gross_outlier,
    loss_weights,
)
from mapmore_cli.modelling.pieces.placement import placements
from mapmore_cli.modelling.pieces.recipe import Recipe
from mapmore_cli.modelling.pieces.segmentation import (
    samples_at,
    scaled_inputs,
)


def quantities_in(terms: Iterable[Expression]) -> tuple[str, ...]:
    """Return the quantities that occur in the terms, in alphabetical order."""
    return tuple(sorted(names_in(terms)))


Placed = tuple[tuple[str, ...], Sequence[Scaling], Sequence[Choice]]
"""The candidates as texts at one placement, and for each output its scaling and the chosen terms.
"""


def fit_together(
    segment: Segment,
    columns: Columns,
    terms: Sequence[Expression],
    recipes: Sequence[Recipe],
    origin: IntArray | None = None,
) -> tuple[SegmentFit, ...]:
    """Choose the scaling and the terms of one segment, and fit the coefficients. The possible
    scalings are those of `placement.placements`. `columns` holds the columns of the segment's
    curve. The `recipes` differ only in their targets. All targets have the same terms and the same
    origin of the scaled inputs.

    `origin`, shape (n,), has a label for each row of the segment. Residuals with the same label are
    treated as correlated.
    """
    texts, scalings, choices = best_placement(segment, columns, terms, recipes, origin)
    return tuple(
        SegmentFit(segment.id, segment.curve, segment.cell, texts, scaling, choice.with_errors())
        for scaling, choice in zip(scalings, choices, strict=True)
    )


def best_placement(
    segment: Segment,
    columns: Columns,
    terms: Sequence[Expression],
    recipes: Sequence[Recipe],
    origin: IntArray | None = None,
) -> Placed:
    """Return the scaling with the smallest sum of squared training residuals (SSE), and the terms
    that were chosen in these scaled coordinates. If several scalings are equally good, the first is
    returned. All scalings divide y by the same number (`y_slope`), so that their SSE can be
    compared. If there are at most a million rows, they are sorted first, so that the result does
    not depend on the order in which they were recorded.
    """
    recipe, n = recipes[0], len(segment.rows)
    most = min(recipe.fit.max_terms, len(terms))
    if n <= most:
        ways = (
            f"use fewer segments, join small ones with `min_samples: {most + 1}`, loosen "
            "`data.keep`"
        )
        message = f"segment {segment.id}: {n} training sample(s), too few for {most} term(s)"
        raise DataError(message, f"{ways}, or set fit.max_terms to less than {max(2, n)}")
    variables = quantities_in(terms)
    outputs = [_samples_of(segment, columns, variables, each, origin) for each in recipes]
    robust = recipe.fit.loss != "squares"
    # With a robust loss, the weights of the samples depend on how the inputs are scaled.
    # Scalings are then compared by the scale of the residuals instead of a weighted sum of squares.
    missed = "scale" if robust else "sse"
    ends = {
        name: np.array(extremes(x)) for name, x in zip(variables, outputs[0].inputs, strict=True)
    }
    best: Placed | None = None
    least = np.inf
    places = zip(*(output.placements(recipe, variables) for output in outputs), strict=True)
    for place, of_outputs in enumerate(places):
        scalings: Sequence[Scaling] = of_outputs
        texts = placed(
            recipe.dictionary,
            tuple((name, *z.tolist()) for name, z in scaled_inputs(scalings[0], ends).items()),
        )
        candidates = terms if texts == recipe.dictionary else list(map(parse, texts))
        try:
            if robust:
                scalings, choices = _robust(candidates, scalings, outputs, recipe, place)
            else:
                choices = _chosen_terms(candidates, scalings, outputs, recipe)
        except NotFinite as error:
            remedy = (
                "terms are evaluated in the scaled coordinates of a segment; set "
                "fit.scaling: none, or remove the term"
            )
            raise DataError(f"segment {segment.id}: {error}", remedy) from error
        left = sum(getattr(choice.selection, missed) for choice in choices)
        if best is None or left < least * (1 - TIE_TOLERANCE):
            least, best = left, (texts, scalings, choices)
    assert best is not None  # there is at least one possible scaling
    return best


# smallest number of samples per term in the fit that finds outliers
SAMPLES_PER_TERM = 3


@dataclass(frozen=True)
class _Samples:
    """Samples of a segment (`inputs` and one output `y`, shape (n,) each) and their weights."""

    inputs: Sequence[Array]
    y: Array
    weighing: Weighing

    def placements(
        self, recipe: Recipe, variables: Sequence[str], robust: Array | None = None
    ) -> tuple[Scaling, ...]:
        """Return all possible scalings of the samples. The weight of a sample follows from its
        uncertainty and from its `robust` weight.
        """
        divisor = self.weighing.by(robust)
        weights = None if divisor is None else divisor**-2.0
        return placements(recipe.fit.scaling, self.inputs, self.y, variables, weights)

    def blocks(
        self, terms: Sequence[Expression], scaling: Scaling
    ) -> Iterator[tuple[Array, Array]]:
        """Yield the values of the terms and of the output, block of rows by block of rows. Both are
        computed in scaled coordinates.
        """
        block_of = dictionary_block(terms)
        for rows in row_blocks(len(self.y)):
            z, target = self.scaled(rows, scaling)
            yield block_of(z, rows), target
            for column in (self.y, *self.inputs) if rows.stop % WIDE == 0 else ():
                give_back(column)

    def scaled(self, rows: slice, scaling: Scaling) -> tuple[dict[str, Array], Array]:
        """Return the inputs by name, and the output, at some of the rows. All are in scaled
        coordinates.
        """
        inputs = {name: x[rows] for name, x in zip(scaling.variables, self.inputs, strict=True)}
        return scaled_inputs(scaling, inputs), (
            self.y[rows] - scaling.y_intercept
        ) / scaling.y_slope


def _samples_of(
    segment: Segment,
    columns: Columns,
    variables: Sequence[str],
    recipe: Recipe,
    origin: IntArray | None,
) -> _Samples:
    unsure = uncertainty_of(recipe.target)
    unsure_columns = [unsure] if unsure in columns else []
    samples = samples_at(columns, segment.rows, (*variables, recipe.target, *unsure_columns))
    n = len(samples[recipe.target])
    recorded = np.arange(n) if n <= MOST else None
    if samples[recipe.target].nbytes <= LONG:
        recorded = order = np.lexsort(
            [samples[name] for name in (*unsure_columns, recipe.target, *variables[::-1])]
        )
        samples = columns_at(samples, order)
        origin = None if origin is None else origin[order]
    weighing = Weighing(
        samples[unsure] if unsure_columns else None,
        recipe.fit.loss,
        recipe.fit.known_scale,
        origin,
        recipe.fit.weight == "curve",
        recorded,
    )
    return _Samples([samples[name] for name in variables], samples[recipe.target], weighing)


def _robust(
    terms: Sequence[Expression],
    scalings: Sequence[Scaling],
    outputs: Sequence[_Samples],
    recipe: Recipe,
    place: int,
) -> tuple[Sequence[Scaling], Sequence[Choice]]:
    """Choose a scaling and terms that do not depend on single outliers.

    Outliers are found by two robust fits with a free constant. One fit has as many terms as the
    segment, and the other has so many terms that it follows the curve closely. An outlier that
    pulls a fit towards itself has a small residual. It is found by a further fit, which leaves this
    sample out. The weights of the samples follow from the residuals of each fit, and the scaling
    follows from the weights. In each scaling, the terms are chosen twice: the robust fit begins
    with these weights, or with equal weights. The result with the smallest scale of the residuals
    is used.
    """
    free = [*terms, parse("1")]
    n = len(outputs[0].y)
    most = recipe.fit.max_terms
    ways = []
    for count in dict.fromkeys((most + 1, max(most + 1, min(len(free), n // SAMPLES_PER_TERM)))):
        more = replace(recipe, fit=replace(recipe.fit, max_terms=count, tolerance=0.0))
        choices = _chosen_terms(free, scalings, outputs, more)
        anchored = []
        starting = []
        for output, scaling, choice in zip(outputs, scalings, choices, strict=True):
            selection = choice.selection
            chosen = [free[i] for i in selection.chosen]
            blocks = output.weighing.rows(partial(output.blocks, chosen, scaling))()
            left = np.concatenate([y - P @ selection.theta for P, y in blocks]) / selection.scale
            outlier = None
            if n <= SHORT:
                every = free if n - len(free) > FREEDOM else chosen
                ((P, y),) = output.weighing.rows(partial(output.blocks, every, scaling))()
                deleted, outlier = gross_outlier(P, y)
                if outlier is not None and abs(left[outlier]) < LARGEST_TUNING:
                    left = deleted
            weighing = output.weighing.without(outlier, loss_weights(recipe.fit.loss, left))
            anchored.append(output.placements(recipe, scaling.variables, weighing.start)[place])
            starting.append(replace(output, weighing=weighing))
        ways += [
            (anchored, _chosen_terms(terms, anchored, some, recipe)) for some in (outputs, starting)
        ]
    return min(ways, key=lambda way: sum(choice.selection.scale for choice in way[1]))


def _chosen_terms(
    terms: Sequence[Expression],
    scalings: Sequence[Scaling],
    outputs: Sequence[_Samples],
    recipe: Recipe,
) -> tuple[Choice, ...]:
    """Return, for each output, the terms that FROLS chooses.

    The dictionary is built block by block if one or two passes over it are enough, so that it is
    never in memory as a whole.
    """
    n = len(outputs[0].y)
    how = recipe.fit
    stopping = Stopping(how.max_terms, how.tolerance, how.stop)
    weighings = [
        output.weighing.in_unit(scaling.y_slope)
        for output, scaling in zip(outputs, scalings, strict=True)
    ]
    problems = [
        Regression(
            partial(output.blocks, terms, scaling),
            weighing,
            lambda chosen, output=output, scaling=scaling: partial(  # type: ignore[misc]
                output.blocks, [terms[i] for i in chosen], scaling
            ),
        )
        for output, scaling, weighing in zip(outputs, scalings, weighings, strict=True)
    ]
    if len(outputs) > 1 or reads_once(n, len(terms), how.max_terms):
        return choose_together(problems, stopping)
    z, target = outputs[0].scaled(slice(0, n), scalings[0])
    P = dictionary_matrix(terms, z, n)
    choice = choose(P, target, stopping, weighings[0])
    # The function `only` is replaced by a function that does not refer to the matrix P.
    # The memory of a wide matrix P is then released before the next matrix is built.
    return (replace(choice, only=problems[0].of),)
