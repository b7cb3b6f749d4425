"""Specs that nobody would write by hand: refused where they stand, before anything is allocated, and never an internal fault."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from spec_examples import STATIC, refusal

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.spec.loader import load
from mapmore_cli.spec.units import is_quantity, split_quantity

CYCLES = "  cycles: {over: strain, samples: 200}"


def changed(old: str, new: str) -> str:
    assert old in STATIC
    return STATIC.replace(old, new)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (changed("samples: 200", "samples: 1000000000"), ["`data.cycles.samples` should be at most 100000"]),
        (changed("count: 4", "count: 1000000000"), ["`segment.strain.count` should be at most 1000"]),
        (changed("method: even, count: 4", "method: optimal, count: 21"), ["21 segments do not fit on a grid of 20 cells"]),
        (changed("  reader: csv", "  skip_rows: 100000000000000000000000"), ["`data.skip_rows` should be at most"]),
        (changed("  reader: csv", "  header: 100000000000000000000000"), ["`data.header` should be at most"]),
        (changed("  reader: csv", "  every: 100000000000000000000000"), ["`data.every` should be at most"]),
        (changed("{pressure: [250]}", "{fraction: 0.5, seed: -1}"), ["`data.split.validate.seed` should be at least 0"]),
        (changed("segment:\n  strain", "segment:\n  time"), ["they have no `time` any more", "name `strain`"]),
        (changed("{pressure: [250]}", "{time: {between: [[1, 2]]}}"), ["they have no `time` any more"]),
        (changed("of: [strain], order: 4", "of: [time], order: 4"), ["they have no `time` any more"]),
        (changed("tolerance: 1.0e-4", "ridge: 1.0e-10"), ["lost in rounding"]),
        (changed("kind: mckibben", r'kind: "\U0011ffff"'), [r"\U0011ffff is no character"]),
        (changed("kind: mckibben", r'kind: "\ud800"'), ["half of a character"]),
        (changed("load_cycle_*.csv", "e" * 300), ["no path is as long"]),
        (changed("load_cycle_*.csv", "e/" * 3000), ["no path is as long"]),
        (changed("load_cycle_*.csv", r"\0.csv"), ["zero byte"]),
        (changed("of: [strain], order: 4", "of: [str\u0430in], order: 4"), ["not the name of a quantity"]),  # a Cyrillic letter
        (changed("  - polynomial", "  - terms: [exp(-str\u0430in)]\n  - polynomial"), ["unexpected character '\u0430'"]),
        (changed("    strain:   {", "    str\u0430in: {"), ["cannot be the name of a quantity"]),
        (changed("name: dmsp", "name: dm\u0455p"), ["`name` cannot be the text"]),
        (f"extends: {'x' * 300}.yaml\n", ["no path is as long"]),
    ],
)  # fmt: skip
def test_refused_where_it_stands(tmp_path: Path, text: str, words: list[str]) -> None:
    message = refusal(tmp_path, text)
    for word in words:
        assert word in message


def test_a_long_chain_of_files_is_refused(tmp_path: Path) -> None:
    for number in range(1500):
        (tmp_path / f"{number}.yaml").write_text(f"extends: {number + 1}.yaml\n")
    (tmp_path / "1500.yaml").write_text(STATIC)
    with pytest.raises(SpecError, match="more than 20 files extend each other"):
        load(tmp_path / "0.yaml")


@pytest.mark.parametrize(
    "text", ["1" * 100_000 + "\n", "1" * 100_000 + "\nx", " " * 100_000, "+" + "1" * 50_000 + "." + "1" * 50_000 + "!"]
)
def test_long_numbers_are_read_in_one_go(tmp_path: Path, text: str) -> None:
    """One way to match each: a pattern that tries others would take hours here."""
    assert is_quantity(text) == text.endswith(("x", "!"))
    quoted = text.replace("\n", "\\n")
    assert "length" in refusal(tmp_path, changed("length: 88 mm", f'length: "{quoted} mm"'))


@given(
    st.floats(allow_nan=False, allow_infinity=False), st.sampled_from(["kPa", "mm", "%", "1", "kPa/s"]), st.sampled_from(["", " ", "\t"])
)
def test_quantities_are_taken_apart(number: float, unit: str, blank: str) -> None:
    blank = blank or (" " if unit == "1" else "")
    assert split_quantity(f" {number!r}{blank}{unit} ") == (number, unit)


def test_wholly_optimal_boundaries_need_terms(tmp_path: Path) -> None:
    text = changed("method: even, count: 4", "method: optimal, count: 4") + "\nmodel: {type: literature, name: sarosi}\n"
    assert "`optimal` places boundaries by fits of terms" in refusal(tmp_path, text.replace("fit:  {", "fit: {"))
