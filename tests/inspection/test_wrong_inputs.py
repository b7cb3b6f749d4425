"""No headline comes of a wrong input: a column that is taken for what it is not is an open
question, in whatever folder.

Folders have sensors twice (in volts, in counts), columns in any order, other units, titles or none,
and several specimens.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded import drafts, loaded, write

from mapmore_cli.domain.errors import DataError, UsageError
from mapmore_cli.pipeline.inspection import inspect
from mapmore_cli.study.units import convert

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


@dataclass(frozen=True)
class Rig:
    """What stands in the files of a rig: the names of its columns in their order, their titles or
    none, and how files are called.
    """

    order: list[str]
    unit: str
    titles: list[str] | None
    words: str
    seed: int

    def name_of(self, column):
        """What a column of a draft holds."""
        return self.order[column if isinstance(column, int) else (self.titles or []).index(column)]

    def save(self, folder):
        """Write a file for each pressure."""
        for bar in (1, 2, 3, 4):
            columns = measured(bar, self.seed)
            for name in ("pressure", "command"):
                columns[name] = convert(columns[name], "kPa", self.unit)
            head = "\t".join(self.titles) + "\n" if self.titles else None
            name = self.words.format(bar=bar)
            write(folder / f"{name}.txt", [columns[name] for name in self.order], head, "\t")


@st.composite
def rigs(draw):
    """A rig with other sensors beside those that matter."""
    more = draw(
        st.lists(st.sampled_from([*SENSORS, "temperature", "command"]), unique=True, max_size=4)
    )
    order = draw(st.permutations(["time", "pressure", "displacement", "force", *more]))
    unit = draw(st.sampled_from(UNITS))
    titles = (
        [draw(st.sampled_from(TITLES[name])).format(u=unit) for name in order]
        if draw(st.integers(0, 4))
        else None
    )
    return Rig(
        [*order],
        unit,
        titles,
        draw(st.sampled_from(["Circle_{bar}bar", "run{bar}"])),
        draw(st.integers(0, 9)),
    )


def measured(bar, seed):
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


@settings(
    max_examples=int(os.environ.get("MAPMORE_EXAMPLES", "8")),
    derandomize="MAPMORE_EXAMPLES" not in os.environ,
)
@given(rigs())
def test_a_wrong_column_is_an_open_question_and_no_sensor_is_taken_twice(rig):
    with TemporaryDirectory() as place, suppress(DataError, UsageError):  # refused: no headline
        rig.save(Path(place))
        for draft in drafts(Path(place)):
            assert rig.titles is not None
            holds_true(draft, rig, Path(place))


def holds_true(draft, rig, folder):
    units = {"pressure": rig.unit, "displacement": "mm", "force": "N", "time": "s"}
    taken = {
        name: (rig.name_of(entry["column"]), entry.get("unit"))
        for name, entry in draft.data["columns"].items()
    }
    wrong = {
        name
        for name, (of, unit) in taken.items()
        if name in units and (of != name or unit != units[name])
    }
    assert wrong <= {loc[-1] for loc in draft.open}, draft.text()
    signals = [SENSORS.get(of, of) for of, _ in taken.values()]
    assert len(set(signals)) == len(signals), draft.text()
    spec = loaded(draft, folder)
    assert len(spec.spec.unconfirmed) == draft.text().count("# CHECK: ")
    found = inspect(spec)
    assert "same-signal" not in [issue.id for issue in found.issues]
