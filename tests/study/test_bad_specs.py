"""Documents that must be refused: each with its place, what is wrong, and what would be right."""

import re
from contextlib import nullcontext
from pathlib import Path
from time import process_time

import pytest
from hypothesis import given
from hypothesis import strategies as st
from spec_examples import (
    DAMPING,
    FORCE,
    FORMULA,
    JOINT,
    LOGS,
    MEASURED,
    MOTION,
    MOVING,
    RECORD,
    SEVERAL,
    STATIC,
    refusal,
)

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.study.loader import load, load_text
from mapmore_cli.study.units import is_quantity, split_quantity

EVEN = "{method: even, count: 4}"
OWN = """{name: own, source: me, expression: "a1*pressure*exp(a3*strain)",
    parameters: {a1: {unit: N}, a3: {bounds: [-250, 250]}}}"""
BASES = {
    **{"STATIC": STATIC, "MEASURED": MEASURED, "LOGS": LOGS, "FORMULA": FORMULA, "FORCE": FORCE},
    **{"MOTION": MOTION, "DAMPING": DAMPING, "ALONE": "name: a\n"},
    **{"SEVERAL": SEVERAL, "MOVING": MOVING, "JOINT": JOINT},
    "JOINT_OF_RUNS": JOINT.replace("formula: chou_hannaford", "model: muscle.yaml"),
    "OWN": f"{FORMULA.replace('sarosi', 'own')}formulas: [{OWN}]\n",
    "OPTIMAL": STATIC.replace(EVEN, "{method: optimal, count: 4}"),
    "DERIVED": FORCE.replace("target: static", "target: damping\nneeds: {static: s.yaml}").replace(
        "3}}", "3}}, plateau: auto"
    ),
    "NO_DELAYS": RECORD.replace("max_terms: 12, stop: bic", "max_terms: 4"),
    "PLAYED": FORCE.replace("[{", "[▸{play: {of: [pressure]}}, {"),
}


def slips():
    """The slips of `slips.txt`: base, what it says, what it says instead, words of the message."""
    base = None
    for block in Path(__file__).with_name("slips.txt").read_text("utf-8").split("\n\n"):
        said = {"@": [], "-": [], "+": [], "!": [], "#": []}
        for row in block.splitlines():
            said[row[0]].append(row[2:])
        base = BASES[said["@"][0]] if said["@"] else base
        if said["-"]:
            yield base, "\n".join(said["-"]), "\n".join(said["+"]), said["!"]


ODD_SLIPS = [
    (STATIC, "load_cycle_*.csv", "e" * 300, ["more than a system allows"]),
    (STATIC, "load_cycle_*.csv", "e/" * 3000, ["more than a system allows"]),
    # a Cyrillic letter
    (STATIC, "of: [strain], order", "of: [str\u0430in], order", ["not the name of a quantity"]),
    (
        STATIC,
        "- polynomial",
        "- terms: [exp(-str\u0430in)]\n  - polynomial",
        ["unexpected character '\u0430'"],
    ),
    (STATIC, "    strain:   {", "    str\u0430in: {", ["cannot be the name of a quantity"]),
    (STATIC, "name: dmsp", "name: dm\u0455p", ["`name` cannot be the text"]),
]


PARTS = 8


@pytest.mark.parametrize("part", range(PARTS))
def test_one_slip_gives_one_message_with_its_place(tmp_path, part):
    """The mistake is where `new` has a mark, a triangle, which is left out; there is no other
    message then.
    """
    wrong = []
    for base, old, new, words in [*slips(), *ODD_SLIPS][part::PARTS]:
        assert old in base
        before, mark, after = base.replace(old, new, 1).partition("▸")
        message = refusal(tmp_path, before + after)
        place = f"{before.count(chr(10)) + 1}:{len(before) - before.rfind(chr(10))}"
        is_there = message.startswith(f"spec.yaml:{place}: ") and message.count("spec.yaml:") == 1
        if not all(word in message for word in words) or (mark and not is_there):
            wrong.append((new, place, words, message))
    assert wrong == []


def test_all_mistakes_are_reported_at_once_in_the_order_of_the_file(tmp_path):
    text = (
        STATIC.replace("muscle: {", "muscle: {nmae: x, ")
        .replace("{column: eps}", "{column: eps, unit: kpa}")
        .replace("over: strain", "over: sprain")
    )
    text = (
        text.replace("max_terms: 1", "max_terms: none")
        .replace("order: 4", "order: 99")
        .replace("sarosi", "sarosy")
        + "name: again\n"
    )
    message = refusal(tmp_path, text)
    starts = [line.split(": ")[0] for line in message.splitlines() if line.startswith("spec.yaml")]
    assert starts == [
        f"spec.yaml:{place}"
        for place in ("3:10", "10:35", "12:18", "19:39", "21:41", "24:13", "27:1")
    ]


@pytest.mark.parametrize("section", ["name", "data", "target", "fit"])
def test_a_misspelt_key_hides_no_mistake_of_another_kind(tmp_path, section):
    text = STATIC.replace("{column: eps}", "{column: eps, unit: kpa}")
    message = refusal(tmp_path, re.sub(rf"(?m)^{section}:", f"{section}x:", text))
    assert f"unknown key `{section}x`" in message
    assert message.count("spec.yaml:") == 2


def test_a_misspelt_section_hides_no_mistake_in_it(tmp_path):
    text = STATIC.replace("max_terms: 1", "max_terms: none").replace("\nfit:", "\nfitt:")
    message = refusal(tmp_path, text.replace("scaling: unit_square", "scalling: unit_square"))
    for said in ("unknown key `fitt`", "unknown key `scalling` in `fit`", "`fit.max_terms` should"):
        assert said in message
    assert message.count("spec.yaml:") == 3


def test_a_spec_that_is_in_no_file_has_no_lines(tmp_path):
    with pytest.raises(SpecError) as caught:
        load_text(FORCE.replace("target:", "tarjet:"), "given", tmp_path)
    assert "given: unknown key `tarjet`" in str(caught.value).splitlines()


def test_a_message_shows_the_line_with_a_caret_under_the_mistake(tmp_path):
    lines = refusal(tmp_path, STATIC.replace("max_terms", "max_term")).splitlines()
    assert lines[0] == "spec.yaml:21:30: unknown key `max_term` in `fit`"
    assert (
        lines[1].split(" | ")[1] == "fit:  {scaling: unit_square, max_term: 1, tolerance: 1.0e-4}"
    )
    assert lines[1][lines[2].index("^") :].startswith("max_term")
    assert lines[3] == "  did you mean `max_terms`?"


def test_the_caret_finds_its_place_in_a_long_line(tmp_path):
    padding = ", ".join(f'"file_{i}.csv"' for i in range(60))
    lines = refusal(tmp_path, STATIC.replace("files: [", f"files: [{padding}, 5, ")).splitlines()
    assert lines[1][lines[2].index("^")] == "5"
    assert len(lines[1]) < 130


def test_a_thousand_mistakes_are_counted_rather_than_listed(tmp_path):
    message = refusal(tmp_path, STATIC + "".join(f"unknown_{i}: 1\n" for i in range(1000)))
    assert message.count("unknown key") == 25
    assert message.endswith("... and at least 175 more")


def test_thousands_of_competitors_are_refused_at_once(tmp_path):
    rivals = ", ".join(f"{{model: sarosi, as: c{i}}}" for i in range(1000))
    begun = process_time()
    message = refusal(tmp_path, FORCE + f"\nvalidate: {{against: [{rivals}]}}\n")
    assert "`validate.against` has too many values" in message
    assert process_time() - begun < 5


@pytest.mark.parametrize(
    ("base", "slips", "words"),
    [
        (STATIC, {"columns:": "colums:"}, ["did you mean `columns`?"]),
        (STATIC, {"levels: {": "levls: {"}, ["did you mean `levels`?"]),
        (
            STATIC,
            {"name: dmsp": "taget: 3\nname: dmsp", "sarosi": "sarosy"},
            ["did you mean `target`?", "model `sarosy`"],
        ),
        (
            STATIC.replace('  - terms: ["exp(-strain/0.02)"]\n', ""),
            {"r: 4": "r: 99", "sarosi": "sarosy"},
            ["at most 20", "model `sarosy`"],
        ),
        (
            STATIC.replace(
                '["exp(-strain/0.02)"]',
                "[strain]\n  - polynomial: {of: [strain], order: 98}\n  - terms: [sprain]",
            ),
            {"r: 4": "r: 99"},
            ["`dictionary[0].polynomial.order` should", "`dictionary[2].", "no quantity `sprain`"],
        ),
        (
            FORCE.replace("[{", "[{play: {of: [pressure], widths: [0.1], count: 2}}, {")
            + "fit: {ridge: auto}",
            {"strain], order": "strian], order"},
            ["give either `widths` or `count`", "no quantity `strian`"],
        ),
    ],
)
def test_a_mistake_hides_no_other_one_and_adds_none(tmp_path, base, slips, words):
    for old, new in slips.items():
        assert old in base
        base = base.replace(old, new)
    message = refusal(tmp_path, base)
    assert all(word in message for word in words), message
    assert message.count("spec.yaml:") == len(words), message


@pytest.mark.parametrize(("links", "is_refused"), [(20, False), (21, True)])
def test_a_chain_of_files_has_at_most_twenty_links(tmp_path, links, is_refused):
    for number in range(links):
        (tmp_path / f"{number}.yaml").write_text(f"extends: {number + 1}.yaml\n")
    (tmp_path / f"{links}.yaml").write_text(STATIC)
    told = pytest.raises(SpecError, match="more than 20 files extend each other")
    with told if is_refused else nullcontext():
        load(tmp_path / "0.yaml")


@pytest.mark.parametrize(
    "text",
    [
        "1" * 100_000 + "\n",
        "1" * 100_000 + "\nx",
        " " * 100_000,
        "+" + "1" * 50_000 + "." + "1" * 50_000 + "!",
    ],
)
def test_long_numbers_are_read_in_one_go(tmp_path, text):
    """One way to match each: a pattern that tries others would take hours here."""
    assert is_quantity(text) == text.endswith(("x", "!"))
    quoted = text.replace("\n", "\\n")
    assert "length" in refusal(tmp_path, STATIC.replace("length: 88 mm", f'length: "{quoted} mm"'))


@given(
    st.floats(allow_nan=False, allow_infinity=False),
    st.sampled_from(["kPa", "mm", "%", "1", "kPa/s"]),
    st.sampled_from(["", " ", "\t"]),
)
def test_quantities_are_taken_apart(number, unit, blank):
    blank = blank or (" " if unit == "1" else "")
    assert split_quantity(f" {number!r}{blank}{unit} ") == (number, unit)
