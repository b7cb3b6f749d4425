"""The course of a weight over a transition zone, for every row of `TRANSITIONS`; and where `z_s`
goes.
"""

import ast
import re
from pathlib import Path

import numpy as np
import pytest
from dense_model import S, cell_weight

from mapmore_cli.domain.joining import TRANSITIONS, Fusion
from mapmore_cli.modelling.expressions import evaluate, parse
from mapmore_cli.modelling.expressions.operator import COLUMNS
from mapmore_cli.modelling.pieces.definition import cell_weights

PROJECT = Path(__file__).resolve().parents[3]
T = np.linspace(0, 1, 201)


@pytest.mark.parametrize("name", TRANSITIONS)
def test_weights_rise_from_zero_to_one_and_sum_to_one(name):
    s = TRANSITIONS[name].s(COLUMNS, T)
    np.testing.assert_allclose(s[[0, 100, 200]], [0, 0.5, 1], atol=1e-15)
    np.testing.assert_allclose(s + s[::-1], 1, atol=1e-14)
    assert (np.diff(s) > 0).all()


@pytest.mark.parametrize("name", TRANSITIONS)
def test_the_words_are_the_mathematics(name):
    """As the page has them: `w = F`, or `w = F up to t = 1/2, then G`."""
    first, _, rest = TRANSITIONS[name].words.removeprefix("w = ").partition(" up to t = 1/2, then ")
    halves = [evaluate(parse(text), {"t": T}, len(T)) for text in (first, rest or first)]
    said = np.where(T < 0.5, *halves)
    np.testing.assert_allclose(TRANSITIONS[name].s(COLUMNS, T), said, atol=1e-14)


@pytest.mark.parametrize("name", TRANSITIONS)
def test_weights_of_neighbours_are_those_of_the_equations(name):
    x, boundaries = np.linspace(-1, 5, 61), np.array([0.0, 1.0, 1.5, 4.0])
    found = cell_weights(x, boundaries, Fusion(extrapolation={}, transition=name, z_s=0.3))
    expected = [
        [cell_weight(value, boundaries, place, S[name], 0.3) for place in (1, 2, 3)] for value in x
    ]
    np.testing.assert_allclose(found, expected, atol=1e-14)


def test_pieces_on_a_backbone_are_added_whole_if_nothing_else_is_said():
    assert Fusion(extrapolation={}).shrink == 1


def test_without_zones_a_boundary_belongs_to_the_left_segment():
    found = cell_weights(
        np.array([1.0, 1.1]), np.array([0.0, 1.0, 4.0]), Fusion(extrapolation={}, z_s=0)
    )
    assert found.tolist() == [[1, 0], [0, 1]]


CARRIERS = {"Joining", "Fuse", "Fusion", "z_s"}
ON_THE_WAY = ("study", "fitting", "pipeline", "ingestion", "storage", "domain", "modelling")


def _names_it(tree):
    """Whether code names `z_s`, its class, or an attribute that is the whole of it."""
    above = {id(node.value): node for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    for node in ast.walk(tree):
        match node:
            case ast.Name(word) | ast.Attribute(_, word) | ast.alias(word) if word in CARRIERS:
                return True
            case ast.Attribute(_, "fuse" | "fusion"):
                if id(node) not in above:  # and not another field of it
                    return True
            case ast.keyword("fuse" | "fusion" | "z_s") | ast.arg("fusion" | "z_s"):
                return True
    return False


def test_the_path_of_z_s_from_the_yaml_to_a_prediction_is_as_the_design_says():
    """Files of the package before the pages, without those that see it as a part of something
    else.
    """
    package = PROJECT / "mapmore_cli"
    found = {
        path.relative_to(package).as_posix()
        for room in ON_THE_WAY
        for path in (package / room).rglob("*.py")
        if _names_it(ast.parse(path.read_text()))
    }
    design = (PROJECT / "docs" / "design.md").read_text()
    sentence = design.partition("follow the key `z_s`")[2].partition("No other file")[0]
    assert found == set(re.findall(r"`(\w+/[\w/]+\.py)`", sentence))
    assert len(found) <= 8
