"""The sections `segment` and `fuse`: what they accept, in which unit, and what they refuse."""

from __future__ import annotations

from pathlib import Path

import pytest
from spec_examples import MEASURED, STATIC, load_text, refusal

from mapmore_cli.fitting.kinds.pieces import cuts_of, recipe_of
from mapmore_cli.modelling.pieces.recipe import Cuts
from mapmore_cli.pipeline.stages import segment_slice

EVEN = "{method: even, count: 4}"
FUSE = "fuse: {transition: linear, z_s: 0.25,"


@pytest.mark.parametrize(
    ("cuts", "meant"),
    [
        ("{method: gradient, count: 3}", Cuts("gradient", 3)),
        ("{method: gradient, count: 3, window: 2 %, separation: 0.05}", Cuts("gradient", 3, window=0.02, separation=0.05)),
        ("{method: optimal, count: 2}", Cuts("optimal", 2)),
        ("{method: optimal, count: 2, grid: 30, min_samples: 4}", Cuts("optimal", 2, grid=30, min_samples=4)),
    ],
)
def test_methods_with_their_settings(cuts: str, meant: object, tmp_path: Path) -> None:
    assert cuts_of(load_text(tmp_path, STATIC.replace(EVEN, cuts)).spec.segment) == {"strain": meant}


def test_a_window_has_the_unit_of_its_variable(tmp_path: Path) -> None:
    spec = load_text(
        tmp_path, MEASURED.replace("{method: breakpoints, at: [100 kPa, 2]}", "{method: gradient, count: 2, window: 50 kPa}")
    ).spec
    assert cuts_of(spec.segment) == {"pressure": Cuts("gradient", 2, window=0.5)}  # the study's unit is bar


@pytest.mark.parametrize(
    ("said", "instead", "words"),
    [
        (EVEN, "{▸method: gradient}", ["method `gradient` needs `count`"]),
        (EVEN, "{▸method: optimal}", ["method `optimal` needs `count`"]),
        (EVEN, "{method: even, count: 4, ▸window: 0.1}", ["method `even` has no use for `window`", "remove `window`"]),
        (EVEN, "{method: gradient, count: 2, ▸grid: 9}", ["method `gradient` has no use for `grid`"]),
        (EVEN, "{method: gradient, count: 2, window: ▸0}", ["should be greater than 0"]),
        (EVEN, "{method: optimal, count: 9, ▸grid: 8}", ["9 segments do not fit on a grid of 8 cells"]),
        (EVEN, "{method: ▸gradiant, count: 2}", ["did you mean `gradient`?"]),
        (FUSE, "fuse: {levels: ▸phcip,", ["did you mean `pchip`?"]),
        (FUSE, "fuse: {shrink: ▸1.5,", ["should be at most 1"]),
        (FUSE, "fuse: {shrink: ▸automatic,", ["`fuse.shrink` cannot be the text 'automatic'"]),
        (FUSE, "fuse: {▸shrink: 0.5,", ["there is no residual to carry", "`backbone`"]),
    ],
)
def test_slips(said: str, instead: str, words: list[str], tmp_path: Path) -> None:
    text = STATIC.replace(said, instead)
    message = refusal(tmp_path, text.replace("▸", ""))
    for word in words:
        assert word in message
    line, column = next((i, row.index("▸") + 1) for i, row in enumerate(text.splitlines(), 1) if "▸" in row)
    assert f":{line}:{column}" in message


@pytest.mark.parametrize("key", ["levels: pchip", "align: threshold"])
def test_nothing_to_interpolate_between_without_levels(key: str, tmp_path: Path) -> None:
    pooled = STATIC.replace(FUSE, f"fuse: {{{key}, transition: linear, z_s: 0.25,").replace(EVEN, f"{EVEN}\n  pressure: none")
    assert "there are no levels to interpolate between" in refusal(tmp_path, pooled)


def test_the_way_between_levels_reaches_the_recipe(tmp_path: Path) -> None:
    text = STATIC.replace(
        FUSE, "model: {backbone: sarosi}\nfuse: {levels: pchip, align: threshold, shrink: 1, transition: linear, z_s: 0.25,"
    )
    spec = load_text(tmp_path, text).spec
    recipe = recipe_of("force", spec.data.levels, spec.segment, spec.dictionary, spec.fit, spec.fuse)
    assert (recipe.fuse.levels, recipe.fuse.align, recipe.fuse.shrink) == ("pchip", "threshold", 1.0)


def test_segments_depend_on_the_fit_only_where_boundaries_try_it(tmp_path: Path) -> None:
    """A change of `fit` must not cut the curves anew, unless boundaries are optimal for that fit."""
    more_terms = STATIC.replace("max_terms: 1", "max_terms: 2")
    optimal = "{method: optimal, count: 4}"
    assert segment_slice(load_text(tmp_path, STATIC).spec) == segment_slice(load_text(tmp_path, more_terms).spec)
    tried = (segment_slice(load_text(tmp_path, text.replace(EVEN, optimal)).spec) for text in (STATIC, more_terms))
    assert next(tried) != next(tried)
