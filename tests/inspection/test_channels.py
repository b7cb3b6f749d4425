"""A folder with one file per channel: `init` writes the command that makes one table of them."""

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from reading import refused

from mapmore_cli.annexes.drafting import channels
from mapmore_cli.annexes.drafting.channels import command_for_one_table
from mapmore_cli.annexes.drafting.start import start
from mapmore_cli.domain.errors import UsageError

N = 300
TIME = np.arange(N) / 100
PRESSURE = 300 + 250 * np.sin(3 * TIME)
STRAIN = 0.1 + 0.08 * np.sin(1.3 * TIME)
CHANNELS = {
    "force": (PRESSURE * (1 - 4 * STRAIN) ** 2, "N"),
    "strain": (STRAIN, "1"),
    "pressure": (PRESSURE, "kPa"),
}


def written(folder, has_title, delimiter, end):
    folder.mkdir()
    channels = CHANNELS if delimiter else CHANNELS | {"time": (TIME, "s")}
    for name, (values, unit) in channels.items():
        clock = [f"{t:.2f}{delimiter}" if delimiter else "" for t in TIME]
        rows = [f"{t}{x:.4f}" for t, x in zip(clock, values, strict=True)]
        title = f"time [s]{delimiter}{name} [{unit}]" if delimiter else f"{name} [{unit}]"
        text = end.join([*([title] if has_title else []), *rows]) + end
        (folder / f"{name}.csv").write_bytes(text.encode())


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize(
    ("has_title", "delimiter"), [(True, ""), (False, ""), (True, ","), (True, ";"), (True, "\t")]
)
def test_channels_become_one_table_by_the_command(has_title, delimiter, end, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    written(tmp_path / "it's a log", has_title, delimiter, end)
    with refused("each file holds one channel", "then call `mapmore init`") as caught:
        start(tmp_path / "it's a log", tmp_path)
    command = caught.value.remedy.partition(": ")[2].partition("\n")[0]
    subprocess.run(["bash", "-c", command], check=True)
    (draft,) = start(tmp_path / "it's a log.csv", tmp_path).drafts
    assert {"time", "pressure", "strain", "force"} == draft.data["columns"].keys()
    assert draft.spec["target"] == "force"


def test_two_files_with_two_numbers_each_are_pasted_in_alphabetical_order(tmp_path, monkeypatch):
    for name, end in (("b", "\r\n"), ("a", "\n")):
        (tmp_path / f"{name}.csv").write_bytes(end.join([name, "1", "2", ""]).encode())
    found = Path.iterdir
    monkeypatch.setattr(Path, "iterdir", lambda folder: sorted(found(folder), reverse=True))
    command = command_for_one_table(tmp_path)
    assert command.startswith(f"paste {tmp_path}/a.csv {tmp_path}/b.csv | tr -d '\\r' > ")
    monkeypatch.setattr(channels, "LARGEST", 9)  # the size of the larger file
    assert command_for_one_table(tmp_path) == command
    monkeypatch.setattr(channels, "LARGEST", 8)
    assert command_for_one_table(tmp_path) is None
    assert command_for_one_table(tmp_path / "a.csv") is None


@pytest.mark.parametrize(
    "change",
    [
        *("another clock", "shorter", "a second column", "words", "alone", "blank", "mark"),
        *("a title of another file", "a wide row", "no title"),
    ],
)
def test_files_that_do_not_fit_get_no_such_command(change, tmp_path):
    written(tmp_path / "a", True, ",", "\n")
    first = tmp_path / "a/force.csv"
    text = first.read_text()
    if change == "alone":
        for other in (tmp_path / "a").glob("*r*"):
            other.unlink()
    first.write_text(
        {
            "another clock": text.replace("0.02,", "0.021,"),
            "shorter": text[: text.rindex("\n", 0, -1) + 1],
            "a second column": text.replace("\n", ",1\n"),
            "words": re.sub(r"(?m)^0\.50,.*$", "0.50,stop", text),
            "alone": text,
            "a wide row": text.replace("0.50,", "0.50,1,"),
            "no title": "\n" + text.partition("\n")[2],
            "blank": text.replace("0.50,", "\n0.50,"),
            "mark": f"\ufeff{text}",
            "a title of another file": text.replace("force [N]", "strain [1]"),
        }[change]
    )
    with pytest.raises(UsageError, match="do not say which column") as caught:
        start(tmp_path / "a", tmp_path)
    assert "one channel" not in caught.value.message
    assert "one channel" not in (caught.value.remedy or "")
