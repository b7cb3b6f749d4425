"""Tables of models of motion, by hand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

from mapmore_cli.annexes.motion import convergence
from mapmore_cli.annexes.motion.body import (
    BUMPLESS,
    HARD,
    Motion,
    MotionFit,
    MotionSection,
    SectionSearch,
)
from mapmore_cli.annexes.motion.page import sections_table, show_fit, tables, waveforms_table
from mapmore_cli.annexes.motion.simulation import motion_errors
from mapmore_cli.domain.recording import Quantity

SECTIONS = (
    MotionSection("1", 1, "all", -0.2, 0.9, np.array([0.3, 0.1])),
    MotionSection("2", 2, "all", 0.1, 0.2, np.array([0.5, 0.2])),
)
MOTION = Motion("u", "y", 0.25, HARD, (2.0,), False, 0.0, ("u", "1"), SECTIONS, (0.0, 5.0))
SEARCHES = tuple(
    SectionSearch(section.id, 30, 0.125, 400, np.array([3.0, 2.0, 1.0])) for section in SECTIONS
)
FIT = MotionFit(MOTION, "particle_swarm", SEARCHES)


def test_parameters_poles_and_gains_of_sections():
    table = sections_table({"mapmore": FIT}, "mm")
    first, second = table.rows
    search = (0.125, 30, "particle swarm", 2, 400)
    poles = 0.5, 0.1 + np.sqrt(0.11)  # of z^2 - P2 z - P1
    steady = (0.3 * 2 + 0.1) / 0.3, (0.5 * 5 + 0.2) / 0.7  # at the upper end of each section
    for row, head, radius, output in (
        (first, ("1", "below 2", -0.2, 0.9, 0.3, 0.1), poles[0], steady[0]),
        (second, ("2", "from 2 on", 0.1, 0.2, 0.5, 0.2), poles[1], steady[1]),
    ):
        assert row == ("mapmore", *head, *map(pytest.approx, (radius, output)), *search)
    assert table.headings[5:7] == ("P3", "weight of 1")
    assert "Samples are 0.25 s apart." in table.notes
    assert len(table.notes) == 2
    joined = replace(FIT, model=replace(MOTION, switching=BUMPLESS))
    assert len(sections_table({"mapmore": FIT, "joined": joined}, "mm").notes) == 3
    shown, (same,) = show_fit(FIT)
    assert same.rows == table.rows
    first, _ = shown["motion"]["sections"]
    assert first["gain"] == pytest.approx(0.3 / 0.3)
    assert np.ravel(first["poles"]) == pytest.approx([0.5, 0, 0.4, 0])


def test_a_section_without_a_constant_has_a_steady_output_of_its_input_alone():
    section = replace(SECTIONS[0], weights=np.array([0.3]))
    motion = replace(MOTION, boundaries=(), drives=("u",), sections=(section,))
    fit = MotionFit(motion, "particle_swarm", SEARCHES[:1])
    (row,) = sections_table({"mapmore": fit}, "mm").rows
    assert row[-6:-5] == (pytest.approx(0.3 * 5 / 0.3),)


def test_searches_are_lines_that_are_dashed_if_the_input_falls():
    falling = replace(SECTIONS[1], direction="fall")
    exact = replace(SEARCHES[1], history=np.array([2.0, 0.0]))
    fit = replace(
        FIT,
        model=replace(MOTION, sections=(SECTIONS[0], falling)),
        searches=(SEARCHES[0], exact),
    )
    inputs = SimpleNamespace(fits={"mapmore": fit, "other": None}, target=Quantity("y", "mm"))
    (drawing,) = convergence.draw(inputs)
    (panel,) = drawing.panels
    assert panel.data["section"].tolist() == ["1"] * 3 + ["2"] * 2
    assert panel.data["iteration"].tolist() == [0, 1, 2, 0, 1]
    assert panel.data["lowest RMSE [mm]"].tolist() == [3, 2, 1, 2, 0]
    ax = Figure().subplots()
    panel.draw(ax)
    rising, dashed = ax.lines
    assert (rising.get_linestyle(), dashed.get_linestyle()) == ("-", "--")
    assert rising.get_ydata().tolist() == [3, 2, 1]
    assert 0 < dashed.get_ydata()[1] < 1e-300  # an exact fit, on a logarithmic axis
    assert ax.get_yscale() == "log"
    assert convergence.draw(SimpleNamespace(fits={"other": None})) == []


@pytest.mark.parametrize("shown", [None, "some samples"])
def test_errors_are_those_of_whole_recordings_that_were_held_out(shown):
    n = 24
    u = np.sin(2 * np.pi * np.arange(n) / 12)
    columns = {"u": np.tile(u, 3), "y": np.tile(2 * u, 3)}
    columns = {name: np.append(x, x[-1]) for name, x in columns.items()}
    origin = np.append(np.repeat([0, 1, 2], n), 3)  # a single sample has no velocity
    held_out = (origin > 0) & (np.arange(3 * n + 1) != 2 * n)  # one sample of the third trains
    curve = SimpleNamespace(
        columns=columns,
        held_out=held_out,
        recordings=("a", "b", "c", "d"),
        logs=[np.flatnonzero(origin == number) for number in range(4)],
    )
    rng = np.random.default_rng(0)
    good = columns["y"] + 0.1 * rng.normal(size=3 * n + 1)
    predictions = {"mapmore": [good], "lost": [np.where(origin == 1, np.nan, good)]}
    inputs = SimpleNamespace(
        target=Quantity("y", "mm"),
        validation=SimpleNamespace(shown=shown, predictions=predictions),
        dataset=SimpleNamespace(curves=[curve], target="y"),
    )
    rows = waveforms_table(inputs, MOTION).rows
    b = slice(n, 2 * n)
    errors = motion_errors(columns["y"][b], good[b], columns["u"][b], 0.25)
    assert rows == (() if shown else (("b", "mapmore", *errors),))
    for fits, names in (({"mapmore": FIT, "other": None}, ["waveforms", "sections"]), ({}, [])):
        inputs.fits = fits
        assert [table.name for table in tables(inputs)] == names
