"""`init` at a terminal: a person answers on a real pseudo-terminal, and a page comes of it."""

import gzip
import json

import numpy as np
import pytest
from init_sessions import SAID, SESSIONS, as_text, session, transcript

SHORT = ("--budget", "1s")
"""Of a search in a process of its own: what is asked does not depend on what it finds."""


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


COLUMNS = "time=0:ms,displacement=2:mm,pressure=3:bar,force=4:N"


def test_who_says_the_columns_has_a_model_without_an_open_question(tmp_path, cylinder, mapmore):
    shown, asked, code = session(tmp_path, cylinder, ("pressure=17:bar,force=4:N", COLUMNS), *SHORT)
    assert code == 0, shown
    assert asked == 2
    assert "Which columns are used" in shown
    assert any(block in shown for block in "▃▅▇")
    assert "there is no column 17" in shown
    text = (tmp_path / "asked.yaml").read_text()
    assert "pressure:     {column: 3, unit: bar}" in text
    assert "as you said" in text
    assert "CHECK:" not in text
    assert "<svg" in (tmp_path / "asked.html").read_text()
    mapmore("run", tmp_path / "asked.yaml", "-q", code=0)
    page = tmp_path / "runs" / "asked" / "report" / "index.html"
    assert "not confirmed" not in page.read_text()


def test_the_target_is_asked_where_names_leave_a_choice(tmp_path, cylinder):
    shown, asked, code = session(
        tmp_path, cylinder, ("time=0:ms,a=2,b=3,c=4", "d", "2", "no"), *SHORT
    )
    assert code == 0, shown
    assert asked == 4, shown
    assert "'d' is none of them" in shown
    text = (tmp_path / "asked.yaml").read_text()
    assert "target: {column: b}" in text
    assert "# CHECK: '1bar' taken as pressure 1 bar" in text


@pytest.mark.usefixtures("quick_families")
def test_without_a_terminal_nothing_is_asked_and_questions_stay_open_until_confirmed(
    tmp_path, cylinder, mapmore, document
):
    spec = tmp_path / "piped.yaml"
    mapmore("init", cylinder, "-o", spec, code=2, says="do not say what is to be predicted")
    for file in cylinder.iterdir():
        titled = b"t\tvolts\tx\tP\tF\n" + gzip.decompress(file.read_bytes())
        file.write_bytes(gzip.compress(titled, mtime=0))
    mapmore("init", cylinder, "-o", spec, code=0)
    checked = document("check", spec, "-q")
    assert len(checked["unconfirmed"]) == spec.read_text().count("# CHECK: ") > 0
    run = json.loads(mapmore("run", spec, "--json", says="not confirmed").stdout)
    assert run["unconfirmed"] == checked["unconfirmed"]
    page = tmp_path / "runs" / run["name"] / "report" / "index.html"
    assert page.read_text().index("not confirmed") < page.read_text().index('class="verdict"')
    for again in (("check", spec, "--confirm"), ("run", spec)):
        assert document(*again, "-q")["unconfirmed"] == []
    assert "not confirmed" not in page.read_text()


@pytest.mark.usefixtures("fewer_families")
def test_one_who_knows_the_columns_needs_one_command(tmp_path, cylinder, mapmore):
    spec = tmp_path / "told.yaml"
    columns = "time:ms,_,displacement:mm,pressure:bar,force:N"
    mapmore("init", cylinder, "-o", spec, "--columns", columns, code=0)
    text = spec.read_text()
    assert "CHECK:" not in text
    assert "levels: {of: pressure" in text
    mapmore("init", cylinder, "-o", spec, "--force", "--columns", "time:parrots,_", code=2)


def test_every_session_is_shown_and_has_at_most_six_answers():
    for name in SAID:
        told = (SESSIONS / f"{name}.txt").read_text(encoding="utf-8").partition("\n")[0]
        assert int(told.split()[0]) <= 6
        assert told.endswith(" 0 open questions.")


def test_a_session_is_what_the_terminal_shows(measured_data):
    shown = (SESSIONS / "printed_cylinder.txt").read_text(encoding="utf-8")
    assert transcript("printed_cylinder", measured_data / "printed_cylinder") == shown


def test_bars_and_colours_do_not_stay_on_the_screen():
    assert (
        as_text("\x1b[1mWhich?\x1b[0m\r\nstructures \u2501\u2501 5%\r\x1b[2Kdone\r\n")
        == "Which?\ndone"
    )
