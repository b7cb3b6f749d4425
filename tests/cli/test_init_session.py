"""`init` at a terminal: a person answers on a real pseudo-terminal, and a page comes of it."""

import gzip
import re

import numpy as np
import pytest
import yaml
from init_sessions import SAID, SESSIONS, as_text, session, transcript


def save(path, columns):
    rows = "\n".join(
        "\t".join(f"{value:.6g}" for value in row) for row in zip(*columns, strict=True)
    )
    path.write_bytes(gzip.compress((rows + "\n").encode(), mtime=0))


@pytest.fixture
def cylinder(tmp_path):
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


ANSWERS = ("force=4:N", "displacement=2:mm,pressure=3:bar,time=0:ms", "3", "")


def numbered(shown):
    """The numbers of a list, and what it calls them."""
    return re.findall(r"^ +(\d+)  ([^\n]+)$", shown.replace("\r", ""), re.MULTILINE)


def test_who_answers_has_a_draft_without_an_open_question(tmp_path, cylinder, mapmore):
    """The numbers of all lists are those that are printed where nobody can be asked."""
    refused = mapmore("init", cylinder, code=2).stderr
    shown, asked, code = session(tmp_path, cylinder, ("17", *ANSWERS))
    assert code == 0, shown
    assert asked == 4  # nothing tells groups apart
    first, *later = as_text(shown).split("Which ")
    assert "no column of numbers is called 17" in first
    assert any(block in first for block in "▃▅▇")
    hint = "  always increases: is it a clock?"
    assert refused.count(hint) == 1
    printed = numbered(refused.replace(hint, ""))
    assert numbered(first) == printed != []
    assert all({*numbered(one)} < {*printed} for one in later)
    text = (tmp_path / "asked.yaml").read_text()
    assert "pressure: {column: 3, unit: bar}" in text
    assert "# you;" in text
    assert "CHECK:" not in text
    assert yaml.safe_load(text)["data"]["split"] == {"validate": {"pressure": [300]}}
    assert len(text.splitlines()) <= 40
    assert "<svg" in (tmp_path / "asked.html").read_text()
    mapmore("check", tmp_path / "asked.yaml", "-q", code=0)


def test_an_answer_can_be_taken_back_and_a_column_that_was_given_away_is_not_offered(
    tmp_path, cylinder
):
    """The column that drives was offered again."""
    replies = ("1", "b", "force=4:N", "4", "3,2", "bend", "recordings", "")
    shown, asked, code = session(tmp_path, cylinder, replies)
    assert code == 0, shown
    assert asked == len(replies) - 1
    assert shown.count("What is to be predicted?") == 2
    assert "the target cannot be an input" in shown
    offered = shown.rpartition("Which columns are the inputs?")[2].partition("Press Enter for all")[
        0
    ]
    assert "column 4" not in offered
    assert "column 3" in offered
    assert "no column of numbers is called bend" in shown
    data = yaml.safe_load((tmp_path / "asked.yaml").read_text())["data"]
    assert data["split"] == {"validate": {"recordings": ["Circle_2bar"]}}


def test_without_a_terminal_nothing_is_asked_and_questions_stay_open_until_confirmed(
    tmp_path, cylinder, mapmore, document
):
    spec = tmp_path / "piped.yaml"
    mapmore("init", cylinder, "-o", spec, code=2, says="do not say which column is to be predicted")
    assert not list(tmp_path.glob("piped.*"))
    for file in cylinder.iterdir():
        titled = b"t\tvolts\tx\tP\tF\n" + gzip.decompress(file.read_bytes())
        file.write_bytes(gzip.compress(titled, mtime=0))
    mapmore("init", cylinder, "-o", spec, code=0)
    checked = document("check", spec, "-q")
    assert len(checked["unconfirmed"]) == spec.read_text().count("# CHECK: ") > 0
    assert document("check", spec, "--confirm", "-q")["unconfirmed"] == []
    assert document("check", spec, "-q")["unconfirmed"] == []


def test_every_session_is_shown_and_has_at_most_four_answers():
    for name in SAID:
        told = (SESSIONS / f"{name}.txt").read_text(encoding="utf-8").partition("\n")[0]
        assert int(told.split()[0]) <= 4
        assert told.endswith(" 0 open questions.")


def test_a_session_is_what_the_terminal_shows(measured_data):
    shown = (SESSIONS / "printed_cylinder.txt").read_text(encoding="utf-8")
    assert transcript("printed_cylinder", measured_data / "printed_cylinder") == shown


def test_bars_and_colours_do_not_stay_on_the_screen():
    assert (
        as_text("\x1b[1mWhich?\x1b[0m\r\nstructures \u2501\u2501 5%\r\x1b[2Kdone\r\n")
        == "Which?\ndone"
    )
