"""No draft has a role that no title, unit or person gave it, whatever a folder holds.

Folders are made from a known truth: which column is a clock, drives, responds, or is junk.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recorded import drafts, loaded, write

from mapmore_cli.domain.errors import UsageError

ROWS = 240


@dataclass(frozen=True)
class Kind:
    """What a column is, how it may be called, and what plain titles make of it."""

    role: str
    titles: tuple[str, ...]
    quantity: str = ""


KINDS = {
    "time": Kind("clock", ("t", "time_s", "Time [ms]", "Zeit (s)"), "time"),
    "P": Kind("drive", ("P", "pressure_kPa", "Pressure (bar)", "P [psig]"), "pressure"),
    "supply": Kind("drive", ("Compressor pressure (bar)", "tank_kPa", "gauge height")),
    "motor": Kind("drive", ("Motor position", "duty cycle", "heater [W]", "n1 (rpm)")),
    "eps": Kind("drive", ("eps", "strain (%)", "contraction_pct"), "strain"),
    "F": Kind("response", ("F", "force_N", "Load (N)", "Kraft [kN]"), "force"),
    "tip": Kind("response", ("Tip z [mm]", "bend", "marker 3", "CH2", "angle (deg)")),
    "T1": Kind("response", ("T1 [degC]", "thermocouple 1", "R_heater (Ohm)")),
    "copy": Kind("copy", ("Load cell raw [V]", "CH7", "bits")),
    "simulated": Kind("computed", ("simulated force", "model output", "F_sim")),
    "constant": Kind("constant", ("base x", "fixed", "gain")),
    "counter": Kind("counter", ("No", "sample", "index")),
    "flag": Kind("flag", ("state", "valve open")),
}
FOLDERS = (
    "run_{n}",
    "test {n}/log",
    "2031-05-0{n}_10{n}112_run/log",
    "{p}kPa_{n}",
    "temp_{q}/take",
)


@st.composite
def truths(draw):
    """Which columns there are, in which order, how they and the files are called."""
    named = draw(st.lists(st.sampled_from(sorted(KINDS)), min_size=2, max_size=7, unique=True))
    titles: dict[str, str] = {}
    for kind in named:
        titles[kind] = draw(st.sampled_from(KINDS[kind].titles))
    below = draw(st.booleans())
    return titles, draw(st.sampled_from(FOLDERS)), draw(st.integers(1, 3)), below


def values_of(kind, run):
    """A column of one recording."""
    k = np.arange(ROWS)
    drive = {
        name: np.sin(0.011 * (place + 2) * k + run)
        + 0.3 * np.cos(0.037 * (place + 1) * k * (run + 1))
        for place, name in enumerate(("P", "supply", "motor", "eps"))
    }
    force = 3 * drive["P"] - drive["eps"] ** 2
    return {
        **drive,
        "time": 0.1 * k,
        "F": force,
        "tip": drive["motor"] ** 3 + 0.2 * drive["supply"],
        "T1": 20 + np.cumsum(drive["motor"] - drive["motor"].mean()) / 9,
        "copy": 0.21 * force + 1.3,
        "simulated": force + 1e-4 * drive["supply"],
        "constant": np.full(ROWS, 7.0),
        "counter": 1.0 * k,
        "flag": (drive["P"] > 0) * 1.0,
    }[kind]


def save(folder, truth):
    """Write the recordings, and return the titles of each kind."""
    titles, name, count, below = truth
    for run in range(count):
        path = folder / (name.format(n=run + 1, p=100 * (run + 1), q=(20, 35, 70)[run]) + ".csv")
        head = ",".join(titles.values()) + "\n" + (",".join("" for _ in titles) + "\n") * below
        write(path, [values_of(kind, run) for kind in titles], head)
    return {title: kind for kind, title in titles.items()}


@settings(
    deadline=None, max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(truth=truths())
def test_no_role_that_no_title_unit_or_person_gave(tmp_path_factory, truth):
    folder = tmp_path_factory.mktemp("rig")
    kinds = save(folder, truth)
    try:
        (draft,) = drafts(folder)
    except UsageError:  # nobody says what is to be predicted, or nothing drives it
        return
    spec = loaded(draft, folder).spec
    told = {name: kinds[one["column"]] for name, one in draft.data["columns"].items()}
    target = draft.output
    responses = {"F"} if "F" in truth[0] else {"F", "tip", "T1", "copy", "eps", "motor"}
    assert told[target] in responses, draft.text()
    for name, kind in told.items():
        assert KINDS[kind].role not in ("computed", "constant", "counter"), draft.text()
        is_called = name in ("time", "pressure", "strain", "force")
        assert not is_called or KINDS[kind].quantity == name, draft.text()
        unit = draft.data["columns"][name].get("unit", "1")
        is_open = not draft.notes["data", "columns", name].sure
        assert unit == "1" or is_open or unit_stands_in(unit, truth[0][kind]), draft.text()
    assert not {"copy"} & set(told.values()) or "F" not in truth[0], draft.text()
    beside = {key for one in draft.data["files"] if isinstance(one, dict) for key in one["set"]}
    assert beside <= {"pressure" if "kPa" in truth[1] else "temp"}, draft.text()
    assert spec.data.split.hold_out is not None
    assert "levels" not in draft.data or draft.data["levels"]["of"] in beside


def unit_stands_in(unit, title):
    """True where the title says the unit, as people write it."""
    written = {"%": ("%", "pct"), "psi": ("psig",), "degC": ("degC",), "ohm": ("Ohm",)}
    return any(one in title for one in written.get(unit, (unit,)))
