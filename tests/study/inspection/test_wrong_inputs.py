"""No headline comes of a wrong input: a column that is taken for what it is not is an open question, in whatever folder.

Folders have sensors twice (in volts, in counts), columns in any order, other units, titles or none, and several specimens.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmore_cli.domain.errors import DataError
from mapmore_cli.spec.loader import load
from mapmore_cli.spec.units import convert
from mapmore_cli.study.drafting import start as drafting
from mapmore_cli.study.drafting.draft import Draft
from mapmore_cli.study.inspection.lint import inspect

TITLES: Mapping[str, tuple[str, ...]] = {
    "time": ("t [s]", "Time", "Zeit (s)"),
    "pressure": ("P [{u}]", "Pressure ({u})", "p_{u}"),
    "displacement": ("Displacement [mm]", "x (mm)", "Weg [mm]"),
    "force": ("Force [N]", "F_N", "Kraft (N)"),
    "volts of force": ("Load cell [V]", "F raw (V)", "ai3"),
    "volts of pressure": ("Pressure sensor [V]", "P_volt", "ai0"),
    "counts of force": ("Force (counts)", "adc7", "F_adc"),
    "temperature": ("T [degC]", "Temp", "room"),
    "command": ("cmd_{u}", "setpoint [{u}]", "u"),
}
UNITS = ("kPa", "bar", "psi", "mbar")
SENSORS = {"volts of force": "force", "counts of force": "force", "volts of pressure": "pressure"}


@st.composite
def rigs(draw: st.DrawFn) -> dict[str, object]:
    """What stands in the files of a rig: the names of its columns in their order, their titles or none, and how files are called."""
    more = draw(st.lists(st.sampled_from([*SENSORS, "temperature", "command"]), unique=True, max_size=4))
    order = draw(st.permutations(["time", "pressure", "displacement", "force", *more]))
    unit = draw(st.sampled_from(UNITS))
    titles = [draw(st.sampled_from(TITLES[name])).format(u=unit) for name in order] if draw(st.booleans()) else None
    words = draw(st.sampled_from(["Circle_{bar}bar", "run{bar}", "S{number}_{bar}bar", "muscle{letter}_pull_{bar}"]))
    return {"order": order, "unit": unit, "titles": titles, "words": words, "seed": draw(st.integers(0, 9))}


def measured(bar: int, seed: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng([seed, bar])
    t = 0.1 * np.arange(125)
    swing = 0.5 - 0.5 * np.cos(2 * np.pi * t / 12)
    pressure = 100.0 * bar + rng.normal(0, 0.3, t.size)
    force = 49.0 * bar - 12 * swing + 4 * np.sign(np.gradient(swing)) + rng.normal(0, 0.2, t.size)
    return {
        "time": t,
        "pressure": pressure,
        "displacement": 30 * swing + rng.normal(0, 0.02, t.size),
        "force": force,
        "volts of force": force / 46.5 + 0.2,
        "volts of pressure": pressure / 100 + 0.5,
        "counts of force": np.round(force * 40 + 2000),
        "temperature": 21 + rng.normal(0, 0.05, t.size),
        "command": np.full(t.size, 100.0 * bar),
    }


def save(folder: Path, rig: dict[str, object]) -> None:
    order, titles, unit = rig["order"], rig["titles"], str(rig["unit"])
    assert isinstance(order, list)
    specimens = 2 if "{number}" in str(rig["words"]) or "{letter}" in str(rig["words"]) else 1
    for specimen in range(specimens):
        for bar in (1, 2, 3, 4):
            columns = measured(bar, int(str(rig["seed"])) + 100 * specimen)
            for name in ("pressure", "command"):
                columns[name] = convert(columns[name], "kPa", unit)
            rows = ["\t".join(f"{value:.7g}" for value in row) for row in zip(*(columns[name] for name in order), strict=True)]
            head = ["\t".join(titles)] if isinstance(titles, list) else []
            name = str(rig["words"]).format(bar=bar, number=specimen + 1, letter="AB"[specimen])
            (folder / f"{name}.txt").write_text("\n".join([*head, *rows]) + "\n")


def wrong(draft: Draft, rig: dict[str, object]) -> list[str]:
    """The quantities whose columns, or units, are not what they are taken for."""
    order, titles = rig["order"], rig["titles"]
    assert isinstance(order, list)
    units = {"pressure": rig["unit"], "displacement": "mm", "force": "N", "time": "s"}
    found = []
    for name, entry in draft.data["columns"].items():
        place = entry["column"] if isinstance(entry["column"], int) else list(titles or ()).index(entry["column"])
        if name in units and (order[place] != name or entry.get("unit") != units[name]):
            found.append(name)
    return found


@pytest.mark.parametrize("titled", [True, False])
def test_a_wrong_column_is_an_open_question_and_no_sensor_is_taken_twice(titled: bool) -> None:
    @settings(max_examples=int(os.environ.get("MAPMORE_EXAMPLES", "8")), derandomize="MAPMORE_EXAMPLES" not in os.environ)
    @given(rigs().filter(lambda rig: (rig["titles"] is not None) == titled))
    def holds(rig: dict[str, object]) -> None:
        with TemporaryDirectory() as place, pytest.MonkeyPatch.context() as patch:
            folder = Path(place)
            patch.setattr(drafting, "proven", lambda draft, _: draft)
            save(folder, rig)
            try:
                drafts = drafting.start(folder, folder).drafts
            except DataError:
                return  # refused: no headline
            for draft in drafts:
                holds_true(draft, rig, folder)

    holds()


def holds_true(draft: Draft, rig: dict[str, object], folder: Path) -> None:
    open_ = {loc[-1] for loc, note in draft.notes.items() if not note.sure}
    assert set(wrong(draft, rig)) <= open_, draft.text()
    order, titles = rig["order"], rig["titles"]
    assert isinstance(order, list)
    places = [
        one["column"] if isinstance(one["column"], int) else list(titles or ()).index(one["column"])
        for one in draft.data["columns"].values()
    ]
    signals = [SENSORS.get(order[place], order[place]) for place in places]
    assert len(set(signals)) == len(signals), draft.text()
    path = folder / f"{draft.name}.yaml"
    path.write_text(draft.text())
    loaded = load(path)
    assert len(loaded.spec.unconfirmed) == draft.text().count("# CHECK: ")
    assert [issue.id for issue in inspect(loaded).issues if issue.id == "same-signal"] == []
    files = {Path(str(recording.source)).name[:7] for recording in inspect(loaded).dataset.recordings}  # type: ignore[union-attr]
    if "{number}" in str(rig["words"]) or "{letter}" in str(rig["words"]):
        assert len({name.split("_")[0] for name in files}) == 1, files
