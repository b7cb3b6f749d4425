"""The tree of a spec: its values, places, and what is put on top of it, by hand."""

from pathlib import Path

import pytest

from mapmore_cli.study.tree import (
    SourceText,
    merged,
    nearest,
    quoted,
    renamed,
    values_at,
    with_child,
    without,
    written,
)
from mapmore_cli.study.yaml_loader import parse


def tree(text):
    return parse(SourceText("a.yaml", Path(), text), [])


SPEC = tree("a: 1\nb: {c: [5, {d: x}, 7], e: 2 kPa}\n")


def plain(node):
    return written(node)


def test_children_are_found_by_key_or_place():
    assert SPEC.child("b").child("c").child(2).value == 7
    assert SPEC.child("b").child("c").child(0).value == 5
    for step in (3, -1, "0"):
        assert SPEC.child("b").child("c").child(step) is None
    assert SPEC.child("x") is None
    assert SPEC.child("a").child("x") is None
    assert SPEC.child(0) is None


@pytest.mark.parametrize(
    ("loc", "found"),
    [
        *(((), None), (("x",), None), (("b", "c", 2), 7), (("b", "c", 2, "x"), 7)),
        *((("a", 0), 1), (("b", "c", 1, "d"), "x")),
    ],
)
def test_the_nearest_node_is_the_last_on_the_way(loc, found):
    node = nearest(SPEC, loc)
    assert (node is SPEC) if found is None else (node.value == found)


def test_texts_know_their_place_and_what_stands_around():
    value = plain(SPEC)
    assert value == {"a": 1, "b": {"c": [5, {"d": "x"}, 7], "e": "2 kPa"}}
    text, inner = value["b"]["e"], value["b"]["c"][1]["d"]
    assert (text.way, text.is_quantity, text.around is value["b"]) == (("b", "e"), True, True)
    assert (inner.way, inner.is_quantity) == (("b", "c", 1, "d"), False)
    dollars = plain(tree("a: $${x}"))["a"]
    assert (dollars, dollars.node.value) == ("${x}", "$${x}")


def test_values_at_a_place_with_their_ways():
    spec = plain(SPEC)
    assert [*values_at(spec, "a")] == [(("a",), 1)]
    assert [way for way, _ in values_at(spec, "b.c.*")] == [("b", "c", n) for n in range(3)]
    assert [*values_at(spec, "b.c.*.d")] == [(("b", "c", 1, "d"), "x")]
    assert [*values_at(spec, "*.e")] == [(("b", "e"), "2 kPa")]
    assert [*values_at(spec, "a.b")] == [*values_at(spec, "x")] == []


@pytest.mark.parametrize(
    ("base", "over", "together"),
    [
        ("{a: 1, b: {c: 2, d: 3}}", "{b: {c: 4}}", {"a": 1, "b": {"c": 4, "d": 3}}),
        ("{a: 1, b: {c: 2}}", "{b: null, e: null}", {"a": 1, "e": None}),
        ("{a: {b: 1}}", "{a: 2}", {"a": 2}),
        ("{a: 2}", "{a: {b: 1}}", {"a": {"b": 1}}),
        ("{a: [1, 2]}", "{a: [3]}", {"a": [3]}),
    ],
)
def test_one_spec_on_top_of_another(base, over, together):
    below = tree(base)
    before = plain(below)
    assert plain(merged(below, tree(over))) == together
    assert plain(below) == before


@pytest.mark.parametrize(
    ("loc", "key", "changed"),
    [
        (("a",), "n", {"b": {"c": 2, "d": 3}, "n": 1}),
        (("b", "c"), "n", {"a": 1, "b": {"d": 3, "n": 2}}),
        (("b", "c"), "d", {"a": 1, "b": {"d": 3}}),
        (("b", "x"), "n", {"a": 1, "b": {"c": 2, "d": 3}}),
    ],
)
def test_a_key_is_renamed_unless_the_new_one_is_there(loc, key, changed):
    assert plain(renamed(tree("{a: 1, b: {c: 2, d: 3}}"), loc, key)) == changed


def test_values_are_removed_and_replaced_in_a_copy():
    before = plain(SPEC)
    assert plain(without(SPEC, ("a",))) == {"b": before["b"]}
    assert plain(without(SPEC, ("b", "c", 1)))["b"]["c"] == [5, 7]
    assert plain(without(SPEC, ("b", "c", 1, "d")))["b"]["c"] == [5, {}, 7]
    assert without(SPEC, ("x", "y")) is SPEC
    changed = with_child(SPEC.child("b").child("c"), 1, SPEC.child("a"))
    assert plain(changed) == [5, 1, 7]
    assert plain(with_child(SPEC, "n", SPEC.child("a")))["n"] == 1
    assert plain(SPEC) == before
    assert quoted(["a", 2]) == "`a`, `2`"
    assert quoted(["a", "b"], " or ") == "`a` or `b`"
