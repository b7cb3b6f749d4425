"""No proposal of `init` fails its own `check` or `run`, whatever a folder holds.

`MAPMORE_EXAMPLES=2000` tries as many folders of each kind, each time others, for as long as it
takes. One that fails is then shown as it is: to make it smaller takes up to five minutes more.
"""

from __future__ import annotations

import gzip
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from recorded import loaded, tree, workbook

from mapmore_cli.annexes.drafting.answers import Answers
from mapmore_cli.annexes.drafting.start import start
from mapmore_cli.domain.errors import DataError, UsageError
from mapmore_cli.pipeline.inspection import inspect
from mapmore_cli.pipeline.runner import bring_up_to_date

Columns = dict[str, np.ndarray]

TITLES: Mapping[str, Sequence[str]] = {
    "t": ("t", "Time", "time [s]", "Zeit (ms)", "timestamp_ms", "elapsed", "Time"),
    "P": (
        "P",
        "pressure",
        "P [bar]",
        "Druck_kPa",
        "p_psi",
        "Pressure (MPa)",
        "supply pressure [kPa]",
    ),
    "eps": ("eps", "strain", "contraction (%)", "Dehnung [%]", "e"),
    "F": ("F", "force [N]", "Kraft/kN", "Load Cell [N]", "tension", "load"),
    "x": ("x", "position_mm", "Displacement [mm]", "length (mm)", "Weg [mm]", "L"),
    "u": ("u", "V", "command [V]", "cmd_kPa", "Soll"),
    "y": ("y", "response", "Ist", "CH2", "sensor_V"),
    "spare": ("state", "n", "Temp [°C]", "CH1", "", "Q", "x", "P"),
}
"""How columns are called; a title with a unit decides the size of the numbers."""

SIZES = {"ms": 1e3, "bar": 0.01, "psi": 0.1450377, "MPa": 1e-3, "%": 100.0, "kN": 1e-3, "mm": 1e3}
"""Numbers for one s, kPa, unit of strain, N and m."""

UNIT_LINES = {
    "t": ("s", "ms"),
    "P": ("kPa", "bar"),
    "eps": ("-", "%"),
    "F": ("N", "kN"),
    "x": ("mm", "m"),
    "u": ("V", ""),
    "y": ("", "V"),
}
EXPERIMENTS: Mapping[str, tuple[str, ...]] = {
    "isobaric": ("t P eps F", "P eps F", "t eps F", "P x F"),
    "isometric": ("t P eps F", "t P F", "P eps F"),
    "scattered": ("P eps F", "P x F", "t P x", "x F"),
    "unknown": ("t u y", "u y"),
}


@dataclass(frozen=True)
class Folder:
    """Files by name, as bytes; tables of the formats of other programs are written by `save`."""

    files: Mapping[str, bytes | Sequence[tuple[str, list[list[Any]]]]]
    length: float | None

    def save(self, place):
        """Write everything below `place`."""
        for name, content in self.files.items():
            path = place / name
            path.parent.mkdir(parents=True, exist_ok=True)
            if isinstance(content, bytes):
                path.write_bytes(
                    gzip.compress(content, mtime=0) if name.endswith(".gz") else content
                )
            elif path.suffix == ".xlsx":
                workbook(path, dict(content))
            else:
                tree(path, {name: _arrays(table) for name, table in content})


def measured(experiment, level, rows, seed):
    """What a muscle of 100 mm does in one recording; SI and kPa."""
    rng = np.random.default_rng(seed)
    swing = 0.5 * (1 - np.cos(np.linspace(0, 2 * np.pi, rows)))
    pressure, strain = np.full(rows, level), 0.2 * swing
    if experiment == "isometric":
        pressure, strain = 400 * np.floor(8 * swing) / 8, np.full(rows, level / 4000)
    elif experiment == "scattered":
        pressure, strain = rng.uniform(50, 400, rows), rng.uniform(0, 0.2, rows)
    pressure = pressure + rng.normal(0, 0.2, rows)
    drive = rng.normal(size=rows).cumsum()
    counter = np.arange(rows) * 1.0
    return {
        "t": 0.02 * counter,
        "P": pressure,
        "eps": strain,
        "F": np.maximum(pressure * (2 - 8 * strain) - 20, 0) + rng.normal(0, 0.5, rows),
        "x": 0.1 * strain,
        "u": drive,
        "y": np.convolve(drive, 0.9 ** np.arange(60) / 10)[:rows],
        "spare": rng.choice([counter, (swing > 0.5) * 1.0, np.full(rows, 3.0)]),
    }


KINDS = ("text", "xlsx", "sheets", "hdf5", "mat", "tdms")


@st.composite
def folders(draw, kinds=KINDS):
    """A campaign of one experiment in files of one of these kinds: everything else about it as it
    comes.
    """
    experiment = draw(st.sampled_from(list(EXPERIMENTS)))
    wanted = draw(st.sampled_from(EXPERIMENTS[experiment])).split()
    names = draw(st.permutations(wanted + ["spare"] * draw(st.integers(0, 2))))
    style = draw(st.sampled_from(["titles", "titles", "none", "units below", "plain"]))
    titles = [
        draw(st.sampled_from(TITLES[name])) if style == "titles" else TITLES[name][0]
        for name in names
    ]
    below = [draw(st.sampled_from(UNIT_LINES.get(name, ("",)))) for name in names]
    sizes = [
        _size(title if style == "titles" else unit if style == "units below" else "")
        for title, unit in zip(titles, below, strict=True)
    ]
    header: list[list[Any]] = {"none": [], "units below": [titles, below]}.get(style, [titles])
    header = (
        [[f"rig {draw(st.integers(1, 9))}"], *([] if draw(st.booleans()) else [[]]), *header]
        if draw(st.integers(0, 5)) == 0
        else header
    )
    rows = draw(st.sampled_from([3, 12, 40, 230]))
    levels = draw(
        st.sampled_from(
            [
                (100,),
                (100, 300),
                (100, 200, 300),
                (100, 200, 300, 400),
                (50, 100, 150, 200, 250, 300, 350),
            ]
        )
    )
    holes = draw(
        st.sampled_from(["none", "none", "one", "many", "a column begins late", "an empty column"])
    )
    seed = draw(st.integers(0, 99))
    tables = {}
    for number, level in enumerate(levels):
        values = measured(experiment, float(level), rows, seed + number)
        body = [
            [size * float(values[name][row]) for name, size in zip(names, sizes, strict=True)]
            for row in range(rows)
        ]
        tables[level] = header + _with_holes(body, holes, number)
    return _files(draw, tables, draw(st.sampled_from(kinds)))


def _size(text):
    return next((size for unit, size in SIZES.items() if unit in text), 1.0)


def _with_holes(body, holes, number):
    rng = np.random.default_rng(number)
    for row, cells in enumerate(body):
        if holes == "one" and row == len(body) // 2:
            cells[-1] = None
        elif holes == "many" and rng.random() < 0.2:
            cells[rng.integers(len(cells))] = None
        elif (
            holes == "a column begins late" and row < len(body) // 3
        ) or holes == "an empty column":
            cells[-1] = None
    return body


def _files(draw, tables, kind):
    """The tables as files: of one format, with names that say the level or not, one after the other
    or in one file.
    """
    word = draw(
        st.sampled_from(
            ["run_{:g}", "K_{:g}kPa", "{:g} kPa", "test{:g}", "sub/m_{:g}", "trial_{number}"]
        )
    )
    length = draw(st.sampled_from([None, None, 0.1]))
    if draw(st.integers(0, 4)) == 0:  # everything in one table
        first = next(iter(tables.values()))
        top = next(
            (place for place, row in enumerate(first) if row and isinstance(row[0], float)), 0
        )
        tables = {0.0: [*first[:top], *(row for table in tables.values() for row in table[top:])]}
    named = {
        word.format(level, number=number): table
        for number, (level, table) in enumerate(tables.items())
    }
    if kind == "text":
        return Folder(_as_text(draw, named), length)
    if kind == "sheets":
        other = (
            [("notes", [["operator", "remarks"], ["me", "none"]])] if draw(st.booleans()) else []
        )
        return Folder(
            {
                "campaign.xlsx": [
                    *other,
                    *((name.replace("/", "-"), table) for name, table in named.items()),
                ]
            },
            length,
        )
    suffix = {"xlsx": "xlsx", "hdf5": "h5", "mat": "mat", "tdms": "tdms"}[kind]
    if kind != "xlsx" and draw(st.booleans()):  # every table a group of one file
        return Folder(
            {
                f"campaign.{suffix}": [
                    (f"run_{number}", table) for number, table in enumerate(named.values())
                ]
            },
            length,
        )
    return Folder({f"{name}.{suffix}": [("Run", table)] for name, table in named.items()}, length)


def _as_text(draw, named):
    delimiter, comma = draw(
        st.sampled_from(
            [(",", False), (";", False), (";", True), ("\t", False), ("\t", True), ("  ", False)]
        )
    )
    suffix = draw(st.sampled_from([".csv", ".txt", ".csv.gz"]))
    empty = (
        draw(st.sampled_from(["", "", "nan", "NA", "n/a", "---"]))
        if delimiter.strip() or delimiter == "\t"
        else "nan"
    )
    encoding = draw(st.sampled_from(["utf-8", "utf-8-sig", "cp1252", "utf-16"]))
    end = draw(st.sampled_from(["\n", "\r\n", "\r"]))
    digits = draw(st.sampled_from([5, 6, 9]))

    def cell(value):
        if isinstance(value, float):
            text = f"{value:.{digits}g}"
            return text.replace(".", ",") if comma else text
        text = empty if value is None else str(value)
        return text.replace(" ", "_") or "-" if delimiter == "  " else text

    found = {}
    for name, table in named.items():
        text = end.join(delimiter.join(map(cell, row)) for row in table) + end
        found[name + suffix] = text.encode(encoding, errors="replace")
    return found


def _arrays(table):
    """The columns of a table as arrays with names that MATLAB takes; what is missing is not a
    number.
    """
    top = next(
        place
        for place, row in enumerate(table)
        if len(row) > 1 and any(isinstance(cell, float) for cell in row)
    )
    titled = next(
        (row for row in table[:top] if len(row) == len(table[top])), [""] * len(table[top])
    )
    columns = {}
    for place, (title, *cells) in enumerate(zip(titled, *table[top:], strict=True)):
        name = "".join(
            letter if letter.isascii() and letter.isalnum() else "_" for letter in title
        ).strip("_")
        name = name if name[:1].isalpha() and name not in columns else f"c{place}"
        columns[name] = np.array([np.nan if cell is None else cell for cell in cells], dtype=float)
    return columns


# What holds of all of them
# --------------------------------------------------------------------------------------------------

MORE = os.environ.get("MAPMORE_EXAMPLES")
UNUSABLE = (
    "no table of numbers",
    "too few training samples",
    "too few for",  # terms, of a file of three samples
    "it looks like",  # a unit that no title says
    "are one signal",
)
PHASES = (Phase.generate,) if MORE else tuple(Phase)


@pytest.mark.timeout(0 if MORE else 300)
@pytest.mark.parametrize(
    ("kind", "examples"),
    [*((kind, 1) for kind in KINDS), pytest.param("text", 20, marks=pytest.mark.long)],
)
def test_no_proposal_fails_its_own_check_or_run(tmp_path_factory, kind, examples):
    @settings(
        deadline=None,
        max_examples=int(MORE or examples),
        derandomize=MORE is None,
        phases=PHASES,
        suppress_health_check=list(HealthCheck),
    )
    @given(folders([kind]))
    def holds(campaign):
        place = tmp_path_factory.mktemp(kind)
        campaign.save(place)
        hold_true(place, campaign.length)

    holds()


def hold_true(place, length):
    """Every draft of a folder passes its check and its run, and holds out what is there; a folder
    without any says why of every file.
    """
    try:
        drafts = start(place, place, answers=Answers(length=length)).drafts
    except UsageError:  # nothing says what is to be predicted
        return
    except DataError as refusal:
        assert any(words in str(refusal) for words in UNUSABLE), refusal  # noqa: PT017
        return
    for draft in drafts:
        spec = loaded(draft, place)
        found = inspect(spec)
        assert found.verdict is None, draft.text()
        assert found.dataset is not None
        held_out, levels = spec.spec.data.split.hold_out, spec.spec.data.levels
        values = (
            held_out.quantities.get(levels.of)
            if held_out is not None and levels is not None
            else None
        )
        for level in values if isinstance(values, list) else ():
            assert any(
                curve.level == pytest.approx(level) and curve.held_out.any()
                for curve in found.dataset.curves
            ), draft.text()
        bring_up_to_date(spec, place / "runs", until="validate")
