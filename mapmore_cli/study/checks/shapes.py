"""Check the shapes that `fit.shape` requires, and the limits of coefficients (`sign` and `bounds`)
in the dictionary.
"""

from __future__ import annotations

from collections.abc import Iterator

from mapmore_cli.study.checks.remedies import REMOVE, unknown_quantity
from mapmore_cli.study.diagnostics import Finding, applying
from mapmore_cli.study.experiment import ExperimentSpec
from mapmore_cli.study.sections.dictionary import AlongRange, DictionaryEntry, Products
from mapmore_cli.study.tree import Loc


def shapes(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check the entries of `fit.shape`: each must name a quantity of the study, with words that
    suit this quantity, and the kind of model must be able to keep the shape. Also check that the
    fit can keep the limits of coefficients.
    """
    fit, target = spec.fit, spec.target_quantity
    is_other = spec.model.type not in ("mapmore", "literature")
    weighed = fit.loss != "squares" or fit.weight == "curve"
    kept = fit.shape is not None or any(entry.bounded for entry in spec.dictionary)
    yield from applying(
        (
            weighed and kept,
            "fit.loss" if fit.loss != "squares" else "fit.weight",
            (
                "shapes, signs and bounds are kept by least squares in which all samples count "
                "the same"
            ),
            "use `loss: squares` and `weight: sample` with them",
        )
    )
    for name, words in (fit.shape or {}).items():
        loc: Loc = ("fit", "shape", name)
        yield from unknown_quantity(name, (*spec.quantities, target), loc, on_key=True)
        given_words = {words} if isinstance(words, str) else {*words}
        yield from applying(
            (
                (name == target) != (given_words == {"positive"}),
                loc,
                "`positive` applies to the target, and all other words apply to inputs",
                "write `{target}: positive`, or use another word for the input",
            ),
            (
                is_other,
                loc,
                (
                    "this type of model cannot keep a shape; segments, formulas and terms with "
                    "memory can"
                ),
                REMOVE,
            ),
            (
                spec.has_memory and bool(given_words - {"increasing", "decreasing"}),
                loc,
                "a model with memory can keep only the sign of its static gain: the direction in "
                "which its output at rest follows the input",
                "write `increasing` or `decreasing`",
            ),
            target=target,
        )
    yield from _bounded_terms(spec)


def _bounded_terms(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that the fit can keep the `sign` and the `bounds` of every entry of the dictionary."""
    for i, entry in enumerate(spec.dictionary):
        _, family = entry.family
        inner = family.of if isinstance(family, Products) else []
        yield from applying(
            (
                entry.bounded and (spec.has_memory or isinstance(family, AlongRange)),
                f"dictionary.{i}",
                (
                    "`sign` and `bounds` work only for segments, and for terms that do not "
                    "depend on the training range"
                ),
                "remove them",
            ),
            (
                any(isinstance(entry, DictionaryEntry) and entry.bounded for entry in inner),
                f"dictionary.{i}",
                "`sign` and `bounds` have no effect within products",
                "write them beside `products`",
            ),
        )
