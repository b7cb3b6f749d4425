"""`init` on made-up campaigns: what the draft says, and that it loads."""

from __future__ import annotations

import gzip
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import yaml
from recorded import checked, drafted, loaded, write

from mapmore_cli.annexes.drafting.answers import Answers, Hold
from mapmore_cli.annexes.drafting.preview import preview
from mapmore_cli.annexes.drafting.sources import patterns
from mapmore_cli.annexes.drafting.start import start
from mapmore_cli.domain.errors import DataError
from mapmore_cli.pipeline.runner import bring_up_to_date
from mapmore_cli.storage.readers import READERS

PLAIN = "1,10\n2,20\n3,30\n4,40\n"


@pytest.mark.parametrize(
    ("text", "settings", "titles"),
    [
        ("t,P\n" + PLAIN, {}, ("t", "P")),
        (PLAIN, {"header": False}, ()),
        ('"t","P"\n' + PLAIN, {}, ("t", "P")),
        ("t;P\n" + PLAIN.replace(",", ";"), {"delimiter": ";"}, ("t", "P")),
        ("t\tP\n" + PLAIN.replace(",", "\t"), {"delimiter": "tab"}, ("t", "P")),
        ("t;P\n1,5;10,5\n2,5;20,5\n3;30\n", {"delimiter": ";", "decimal": ","}, ("t", "P")),
        ("  t   P\n" + PLAIN.replace(",", "   "), {"delimiter": "whitespace"}, ("t", "P")),
        ("t,P\ns,kPa\n" + PLAIN, {"header": 2}, ("t", "P")),
        ("Rig 4\n\nt,P\n" + PLAIN, {"skip_rows": 2}, ("t", "P")),
        ("t,P\n1,\n2,20\n,30\n", {}, ("t", "P")),
        ("t,P\r1,2\r3,4\r", {}, ("t", "P")),
        ("t,P\n" + PLAIN + "5,5", {}, ("t", "P")),
        (
            "t,P\n" + "".join(f"{k},{2 * k}\n\n" for k in range(20)) + "end of test\n\n\n",
            {},
            ("t", "P"),
        ),
    ],
)
def test_dialects_are_recognised(tmp_path, text, settings, titles):
    path = tmp_path / "a.csv"
    path.write_bytes(text.encode())
    found = preview(path)
    assert len(found.columns) == 2
    assert (found.reader, found.settings, found.titles) == ("csv", settings, titles)
    zipped = tmp_path / "b.csv.gz"
    zipped.write_bytes(gzip.compress(text.encode()))
    assert preview(zipped) == found


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\x00\x01\x02" * 50,
        b"dear diary\ntoday\n",
        b"1\n2\n3\n",
        b"a,b\n",
        b'"never closed,1\n2,3\n',
    ],
)
def test_what_is_no_table_is_refused(tmp_path, content):
    path = tmp_path / "a.csv"
    path.write_bytes(content)
    with pytest.raises(DataError, match=r"a\.csv"):
        preview(path)
    with pytest.raises(DataError, match="no usable recording"):
        start(tmp_path, tmp_path)


T = np.arange(0, 20, 0.02)
LOOP = 1 - np.abs(T / 10 - 1)


def isobaric(folder, percent=1.0):
    strain = 0.15 * LOOP
    for level in (100, 200, 300, 400):
        columns = {
            "time_s": T,
            "P": level,
            "strain": percent * strain,
            "F": level * (2 - 9 * strain) + 0.1,
        }
        write(folder / f"pull_{level}.csv", columns)


def test_an_isobaric_campaign(tmp_path, monkeypatch):
    """Every recording is read for its columns, for the draft, and to check it."""
    isobaric(tmp_path)
    read, csv = [], READERS["csv"]
    counted = replace(csv, read=lambda path, *how: read.append(path) or csv.read(path, *how))
    monkeypatch.setitem(READERS, "csv", counted)
    (draft,) = start(tmp_path, tmp_path).drafts
    assert Counter(read) == dict.fromkeys(tmp_path.glob("pull_*.csv"), 3)
    data = checked(draft, tmp_path).spec.data
    assert (data.levels.of, data.levels.at) == ("pressure", [100, 200, 300, 400])
    assert data.files == ["pull_*.csv"]
    assert data.cycles.over == "strain"
    assert data.split.hold_out.quantities == {"pressure": [300]}
    assert set(draft.spec) == {"schema_version", "name", "data", "target", "validate"}
    assert ("target",) not in draft.notes
    assert "# one value in each recording: pressure was held, in kPa" in draft.text()
    assert len(draft.text().splitlines()) <= 40


def test_the_held_strain_in_the_names_of_files(tmp_path):
    steps = 600 * np.floor(10 * LOOP) / 10
    for word, strain in (("slack", 0.0), ("bent5", 0.05), ("bent10", 0.1), ("bent15", 0.15)):
        for repeat in (1, 2):
            force = 0.7 * np.maximum(steps - 120 - 2000 * strain, 0) + 0.001 * repeat * T
            write(tmp_path / f"m_{word}_run{repeat}.csv", {"F": force, "P": steps, "t": T})
    draft = drafted(tmp_path, answers=Answers(hold=Hold("strain", "bent", "%")))
    data = checked(draft, tmp_path).spec.data
    assert (data.levels.of, data.levels.at) == ("strain", [0, 0.05, 0.1, 0.15])
    assert [keep.quantity for keep in data.keep] == ["pressure_rate"]
    assert "# CHECK: names: strain 0 5 10 15 % (0 for 'm_slack_run1'" in draft.text()
    assert "numbers not used: run 1" in draft.text()


def test_what_readers_stumble_over_is_named_in_the_draft(tmp_path):
    isobaric(tmp_path)
    for path in tmp_path.glob("*.csv"):
        lines = path.read_text().splitlines()
        lines[5], lines[7] = lines[5].rsplit(",", 1)[0] + ",", lines[6]
        path.write_text("Rig 4\n" + "\n".join(lines).replace(",", ";").replace(".", ",") + "\n")
    draft = drafted(tmp_path)
    data = checked(draft, tmp_path).spec.data
    assert (data.missing, data.repeated_time) == ("drop", "spread")
    assert (data.delimiter, data.decimal, data.skip_rows) == (";", ",", 1)
    assert "missing: drop  # 4 rows have an empty cell" in draft.text()


def test_a_backward_clock_is_left_out(tmp_path):
    isobaric(tmp_path)
    path = tmp_path / "pull_100.csv"
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:5], lines[6], lines[5], *lines[7:]]) + "\n")
    assert checked(drafted(tmp_path), tmp_path).spec.data.glitches == "drop"
    path.write_text("\n".join([*lines[:5], *lines[40:5:-1], *lines[41:]]) + "\n")
    draft = drafted(tmp_path)
    assert "time" not in checked(draft, tmp_path).spec.data.columns
    assert "left out: time_s" in draft.text()


def test_what_is_too_little_for_a_search_is_a_straight_line(tmp_path):
    """Two samples at each of three pressures: too few to leave any out."""
    for level in (100, 200, 300):
        columns = {"P_kPa": level, "eps": [0.0, 0.2], "F_N": [2.0 * level, 0.1 * level]}
        write(tmp_path / f"p_{level}.csv", columns)
    draft = drafted(tmp_path)
    said = draft.open["target",].why
    assert said.startswith(
        "simplified (no levels, and nothing is held out), because `check` found an error: "
        "polynomial_2"
    )
    assert draft.spec["dictionary"] == [{"polynomial": {"of": ["pressure"], "order": 1}}]
    bring_up_to_date(loaded(draft, tmp_path), tmp_path / "runs", until="validate")


def test_an_error_that_the_spec_can_mend_is_said_in_the_draft(tmp_path):
    isobaric(tmp_path, percent=100)
    draft = drafted(tmp_path)
    assert "# CHECK: `check` finds an error: strain reaches 15" in draft.text()
    assert 'write `unit: "%"`' in draft.open["target",].why


# Names and text
# --------------------------------------------------------------------------------------------------


def test_patterns_match_their_files_and_no_others(tmp_path):
    names = ["a_1_up.csv", "a_2_up.csv", "a_1_down.csv", "a_2_down.csv", "[x].csv"]
    files = {name: tmp_path / name for name in names}
    for path in files.values():
        path.write_text(PLAIN)
    assert patterns([files["a_1_up.csv"], files["a_2_up.csv"]], tmp_path) == ["a_*_up.csv"]
    assert patterns([files[name] for name in names[:4]], tmp_path) == ["a_*.csv"]
    assert patterns([files["a_1_up.csv"], files["a_2_down.csv"]], tmp_path) == [
        "a_1_up.csv",
        "a_2_down.csv",
    ]
    assert patterns([files["[x].csv"]], tmp_path) == ["[x].csv"]
    runs = [tmp_path / stamp / "log.csv" for stamp in ("2031-05-04_101112_run", "test_9")]
    for path in runs:
        write(path, {"a": T})
    assert patterns(runs, tmp_path) == ["*/log.csv"]


def stamped(path, stamp, *, odd=""):
    """Ten contractions with a stamp every half a second, as `stamp` writes minutes and seconds; one
    cell of the force may be `odd`.
    """
    rows = []
    for level in range(1, 6):
        for place in range(40):
            k = 40 * level + place
            force = f"{100 * level * (1 - 3 * place / 200):.3f}"
            rows.append(
                f"{stamp.format(k // 120, k / 2 % 60)},{100 * level},{place / 200:.4f},"
                f"{odd if odd and k == 95 else force}"
            )
    path.write_text("\n".join(["time [s],pressure [kPa],strain,force [N]", *rows, ""]))


@pytest.mark.parametrize(
    "stamp",
    ["12:{:02}:{:04.1f}", "2026-03-01 12:{:02}:{:04.1f}", "11:{:02}:{:04.1f} PM", "{:02}:{:04.1f}"],
)
def test_time_stamps_are_read_in_seconds(tmp_path, stamp):
    stamped(tmp_path / "a.csv", stamp)
    spec = yaml.safe_load(drafted(tmp_path).text())
    assert spec["data"]["columns"]["time"]["column"] == "time [s]"
    assert "missing" not in spec["data"]


@pytest.mark.parametrize("odd", ["0:03:20", "TRUE"])
def test_a_cell_that_is_no_number_is_told_rather_than_left_out(tmp_path, odd):
    stamped(tmp_path / "a.csv", "12:{:02}:{:04.1f}", odd=odd)
    with pytest.raises(DataError, match=r"a\.csv:row 57, column force"):
        drafted(tmp_path)
