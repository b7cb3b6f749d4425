"""`init` at a terminal: a person answers on a real pseudo-terminal, and a page comes of it."""

from __future__ import annotations

import gzip
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from init_sessions import SAID, SESSIONS, as_text, session, transcript

SHORT = ("--budget", "1s")
"""Of a search in a process of its own: what is asked does not depend on what it finds."""


def save(path: Path, columns: Sequence[np.ndarray]) -> None:
    rows = "\n".join(
        "\t".join(f"{value:.6g}" for value in row) for row in zip(*columns, strict=True)
    )
    path.write_bytes(gzip.compress((rows + "\n").encode(), mtime=0))


@pytest.fixture
def cylinder(tmp_path: Path) -> Path:
    """A cylinder at four pressures, with its load cell's volts between 1 and 8 beside them."""
    rng = np.random.default_rng(0)
    t = np.arange(600) * 10.0
    (tmp_path / "rig").mkdir()
    for bar in (1, 2, 3, 4):
        position = 20 * (1 - np.cos(2 * np.pi * t / 2000)) + rng.normal(0, 0.05, t.size)
        force = (
            49 * bar
            - 0.4 * position
            + 6 * np.sign(np.sin(2 * np.pi * t / 2000))
            + rng.normal(0, 0.3, t.size)
        )
        save(
            tmp_path / "rig" / f"Circle_{bar}bar.txt.gz",
            (t, force / 46.5, position, bar + rng.normal(0, 0.005, t.size), force),
        )
    return tmp_path / "rig"


def test_enter_takes_the_likeliest_answer_and_nothing_stays_open(
    tmp_path: Path, cylinder: Path, mapmore
) -> None:
    shown, asked, code = session(tmp_path, cylinder, (), *SHORT)
    assert code == 0, shown
    assert 0 < asked <= 10
    assert "Which column is the pressure?" in shown
    assert any(block in shown for block in "▃▅▇")
    text = (tmp_path / "asked.yaml").read_text()
    assert "pressure:     {column: 3, unit: bar}" in text
    assert "CHECK:" not in text
    mapmore("run", tmp_path / "asked.yaml", "--runs", tmp_path / "runs", "-q", code=0)
    assert (
        "not confirmed" not in (tmp_path / "runs" / "asked" / "report" / "index.html").read_text()
    )


def test_an_answer_is_taken_and_one_that_cannot_be_is_asked_again(
    tmp_path: Path, cylinder: Path
) -> None:
    shown, _, code = session(tmp_path, cylinder, ("", "17:bar", "3:kPa*100", "", "", "no"), *SHORT)
    assert code == 0, shown
    assert "there is no column 17" in shown
    text = (tmp_path / "asked.yaml").read_text()
    assert "{column: 3, unit: kPa, scale: 100}" in text
    assert "as you said" in text
    assert "<svg" in (tmp_path / "asked.html").read_text()


@pytest.mark.usefixtures("quick_families")
def test_without_a_terminal_nothing_is_asked_and_guesses_stay_open_until_confirmed(
    tmp_path: Path, cylinder: Path, mapmore
) -> None:
    spec = tmp_path / "piped.yaml"
    mapmore("init", cylinder, "-o", spec, code=0)
    checked = json.loads(mapmore("check", spec, "--json", "-q").stdout)
    assert len(checked["unconfirmed"]) == spec.read_text().count("# CHECK: ") > 0
    run = json.loads(
        mapmore("run", spec, "--runs", tmp_path / "runs", "--json", says="not confirmed").stdout
    )
    assert run["unconfirmed"] == checked["unconfirmed"]
    page = tmp_path / "runs" / run["name"] / "report" / "index.html"
    assert page.read_text().index("not confirmed") < page.read_text().index('class="verdict"')
    for again in (("check", spec, "--confirm"), ("run", spec, "--runs", tmp_path / "runs")):
        assert json.loads(mapmore(*again, "--json", "-q").stdout)["unconfirmed"] == []
    assert "not confirmed" not in page.read_text()


@pytest.mark.usefixtures("fewer_families")
def test_one_who_knows_the_columns_needs_one_command(
    tmp_path: Path, cylinder: Path, mapmore
) -> None:
    spec = tmp_path / "told.yaml"
    columns = "time:ms,_,displacement:mm,pressure:bar,force:N"
    mapmore("init", cylinder, "-o", spec, "--columns", columns, code=0)
    text = spec.read_text()
    assert "CHECK:" not in text
    assert "levels: {of: pressure" in text
    mapmore("init", cylinder, "-o", spec, "--force", "--columns", "time:parrots,_", code=2)


def test_every_session_is_shown_and_has_at_most_ten_answers() -> None:
    for name in SAID:
        told = (SESSIONS / f"{name}.txt").read_text(encoding="utf-8").partition("\n")[0]
        assert int(told.split()[0]) <= 10
        assert told.endswith(" 0 open guesses.")


def test_a_session_is_what_the_terminal_shows(measured_data: Path) -> None:
    shown = (SESSIONS / "printed_cylinder.txt").read_text(encoding="utf-8")
    assert transcript("printed_cylinder", measured_data / "printed_cylinder") == shown


def test_bars_and_colours_do_not_stay_on_the_screen() -> None:
    assert (
        as_text("\x1b[1mWhich?\x1b[0m\r\nstructures \u2501\u2501 5%\r\x1b[2Kdone\r\n")
        == "Which?\ndone"
    )
