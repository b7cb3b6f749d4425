"""`mapmore_cli.fit` and `run`: the words of the spec, the numbers of the command, and nothing left
behind.
"""

import tempfile
from dataclasses import replace
from itertools import count
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from cli_samples import BAR, EPS, write_columns

import mapmore_cli as mm
from mapmore_cli.api import fitted as fitted_module
from mapmore_cli.api.sections import _reader_of
from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.ingestion.globs import expand

# --- one small study
# --------------------------------------------------------------------------------------------------

FRAME = {
    "P [bar]": BAR,
    "eps": EPS,
    "F": 330 * BAR * (1 - 3.2 * EPS) ** 2 - 70 + 40 * np.exp(-EPS / 0.02),
}
SECTIONS = {
    "columns": {
        "pressure": {"column": "P [bar]", "unit": "bar"},
        "strain": {"column": "eps"},
        "force": {"column": "F"},
    },
    "levels": {"of": "pressure", "at": "auto"},
    "split": {"validate": {"pressure": [200]}},
    "dictionary": [{"polynomial": {"of": ["strain"], "order": 4}}],
    "validate": {"against": ["sarosi"]},
}


@pytest.fixture(scope="module")
def fitted():
    return mm.fit(FRAME, segment={"strain": {"method": "even", "count": 4}}, **SECTIONS)


HALVES = slice(None, 100), slice(100, None)


def test_partial_columns_leave_canonical_names_to_the_frame():
    """What is derived, and what one of the frames lacks, is not taken from a column."""
    frame = {"pressure": 100 * BAR, "strain": EPS, "F": FRAME["F"], "length": 1 - EPS}
    sections = {**SECTIONS, "columns": {"force": "F"}}
    one, other = ({key: values[half] for key, values in frame.items()} for half in HALVES)
    found = mm.fit([one, {**other, "time": np.arange(100.0)}], **sections)
    assert {*found.spec.data.columns} == {"force", "pressure", "strain", "length"}
    found = mm.fit(frame, **sections, derive={"strain": "1 - length"})
    assert {*found.spec.data.columns} == {"force", "pressure", "length"}


@pytest.mark.parametrize(
    ("wanted", "seconds", "shown"), [(None, 3, 1), (None, 0, 0), (False, 3, 0)]
)
def test_long_fits_show_a_bar_in_a_terminal(wanted, seconds, shown, monkeypatch, capsys):
    monkeypatch.setenv("FORCE_COLOR", "1")  # as in a terminal
    now = count(0, seconds)
    monkeypatch.setattr("mapmore_cli.api.fitted.time", SimpleNamespace(monotonic=lambda: next(now)))
    with fitted_module._Bar(wanted) as bar:
        bar("segments", 1, 4)
        bar("segments", 4, 4)
    assert ("segments" in capsys.readouterr().err) == shown


def test_a_file_gets_a_line_of_progress_every_five_seconds_and_at_the_end(monkeypatch, capsys):
    clock = SimpleNamespace(now=0.0)
    time = SimpleNamespace(monotonic=lambda: clock.now)
    monkeypatch.setattr("mapmore_cli.api.fitted.time", time)
    with fitted_module._Bar(True) as bar:
        for clock.now, done in ((0.0, 1), (4.9, 2), (5.0, 3), (9.9, 3), (9.95, 4)):
            bar("segments", done, 4)
    assert capsys.readouterr().err == "".join(f"segments: {n} of 4\n" for n in (1, 3, 4))


def test_a_bar_is_drawn_at_most_ten_times_in_a_second(monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    clock = SimpleNamespace(now=0.0)
    time = SimpleNamespace(monotonic=lambda: clock.now)
    monkeypatch.setattr("mapmore_cli.api.fitted.time", time)
    with fitted_module._Bar(True) as bar:
        for clock.now, done, drawn in ((0.0, 1, 1), (0.09, 2, 1), (0.11, 3, 3)):
            bar("segments", done, 9)
            assert bar._bar.tasks[0].completed == drawn


def test_a_target_by_its_label_takes_all_columns_by_theirs():
    motor = np.linspace(0, 1, 50)
    terms = [{"polynomial": {"of": ["motor"], "order": 2}}]
    frame = {"motor": motor, "tip": 3 * motor**2}
    model = mm.fit(frame, target="tip", dictionary=terms, fit={"max_terms": 3})
    np.testing.assert_allclose(model(motor=motor), frame["tip"], atol=1e-9)


def test_predict_uses_the_columns_of_the_fit(fitted):
    by_source = fitted.predict(FRAME)
    canonical = fitted.predict({"pressure": 100 * BAR, "strain": EPS})
    np.testing.assert_allclose(by_source, canonical, rtol=1e-13)
    np.testing.assert_array_equal(canonical, fitted(pressure=100 * BAR, strain=EPS))
    with pytest.raises(DataError, match="no column 'strain'"):
        fitted.predict({"pressure": BAR})


def test_invert_takes_the_output_by_its_name(fitted):
    picked = fitted.invert("pressure", force=200, strain=0.1).picked
    assert fitted(pressure=picked[0], strain=0.1) == pytest.approx(200, rel=1e-6)
    with pytest.raises(TypeError, match="give `force`"):
        fitted.invert("pressure", strain=0.1)


def test_bands_are_fitted_when_they_are_asked_for(fitted):
    assert fitted.model.left_out is None
    low, high = fitted.interval(0.9, pressure=150.0, strain=0.1)
    assert low < fitted(pressure=150.0, strain=0.1) < high
    ax = fitted.plot(interval=0.9)
    assert len(ax.collections) == 5  # four training curves, and the one that was held out
    dashed, dots = ax.lines[-2:]
    np.testing.assert_array_equal(dots.get_ydata(), FRAME["F"][BAR == 2.0])
    np.testing.assert_array_equal(dashed.get_ydata(), fitted(pressure=200, strain=EPS[BAR == 2.0]))


def test_what_is_written_runs_to_the_same_scores(fitted, tmp_path):
    spec = fitted.to_yaml(tmp_path / "not" / "there" / "muscle.yaml")
    written = {"mapmore.schema.json", "muscle.yaml", "muscle_data"}
    assert {path.name for path in spec.parent.iterdir()} == written
    modeline = "# yaml-language-server: $schema=mapmore.schema.json\n"
    assert spec.read_text().startswith(modeline)
    assert "fuse:" not in spec.read_text()  # sections with default values only are left out
    found = mm.run(spec, tmp_path / "runs")
    assert tuple(found.scores) == tuple(fitted.scores)
    assert found.page.is_file()
    assert found.missed == ()
    assert mm.run(spec, tmp_path / "runs").stages["fit"] == "up-to-date"
    assert mm.run(spec, tmp_path / "runs", settings={"validate.require": {"nrmse": 1e-9}}).missed
    path = fitted.save(tmp_path / "model.h5")
    loaded = mm.load_model(path)
    np.testing.assert_array_equal(
        loaded(pressure=150, strain=EPS), fitted(pressure=150, strain=EPS)
    )
    with h5py.File(path, "a") as file:
        file.attrs["checksum"] = "0"
    with pytest.raises(DataError, match="checksum"):
        mm.load_model(path)
    with pytest.warns(UserWarning, match="checksum") as told:
        assert mm.load_model(path, unverified=True).units == loaded.units
    assert told[0].filename == __file__


def test_frames_are_in_memory_and_stay_as_they_are(monkeypatch):
    """Also for a competitor with other settings, which is a run of its own."""

    def refused(*_):
        raise AssertionError("frames are written to a file")

    monkeypatch.setattr(fitted_module, "write_tables", refused)
    halves = [{name: x[rows] for name, x in FRAME.items()} for rows in (BAR < 2.2, BAR > 2.2)]
    before = [{name: x.copy() for name, x in frame.items()} for frame in halves]
    other = {"set": {"fit.max_terms": 1}, "as": "short"}
    found = mm.fit(halves, **{**SECTIONS, "validate": {"against": [other]}})
    for frame, kept in zip(halves, before, strict=True):
        assert all(np.array_equal(frame[name], kept[name]) for name in kept)
    assert {"mapmore", "short"} <= {row["model"] for row in found.scores}
    assert found.spec.data.files == ["recording_1", "recording_2"]
    halves[1]["F"] = np.where(np.arange(len(halves[1]["F"])) == 3, np.nan, halves[1]["F"])
    with pytest.raises(DataError, match=r"frame 2, row 3 \(from 0\), column 'F': the value"):
        mm.fit(halves, **SECTIONS)


def test_nothing_is_written_but_progress(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    mm.fit(FRAME, **SECTIONS, progress=True)
    assert not list(tmp_path.iterdir())
    output = capsys.readouterr()
    assert output.out == ""
    assert "segments: 4 of 4\n" in output.err


def test_it_shows_itself(fitted):
    assert repr(fitted).startswith(
        "<model model: force [N] of pressure [kPa], strain [1]>\nScores (target: static)"
    )
    html = fitted._repr_html_()
    assert html.count("<table ") == 1
    count = len(fitted.equations)
    assert html.count("<li><code>") == 8 < count
    assert f"</ul><p>... {count} equations in all</p>" in html


def test_a_warning_points_to_the_line_that_asked_for_the_fit(tmp_path):
    with pytest.warns(UserWarning, match="its sign seems to be inverted") as of_fit:
        found = mm.fit({**FRAME, "F": -FRAME["F"]}, **SECTIONS)
    spec = found.to_yaml(tmp_path / "turned.yaml")
    with pytest.warns(UserWarning, match="its sign seems to be inverted") as of_run:
        mm.run(spec, tmp_path / "runs")
    assert {one.filename for one in (*of_fit, *of_run)} == {__file__}


def test_a_summary_has_what_a_regression_table_has():
    """By hand: one straight line, y = 2 + 3 x and noise."""
    rng = np.random.default_rng(0)
    x = np.linspace(0, 1, 40)
    y = 2 + 3 * x + 0.1 * rng.normal(size=40)
    model = mm.fit(
        {"x": x, "y": y},
        target="y",
        dictionary=[{"polynomial": {"of": ["x"], "order": 1}}],
        fit={"max_terms": 2, "scaling": "none"},
    )
    line = np.column_stack([np.ones(40), x])
    theta, (sse,) = np.linalg.lstsq(line, y, rcond=None)[:2]
    errors = np.sqrt(sse / 38 * np.diag(np.linalg.inv(line.T @ line)))
    summary = model.summary()
    rows = {row["term"]: row for row in summary.records}
    for term, value, error in zip(("1", "x"), theta, errors, strict=True):
        assert rows[term]["coefficient"] == pytest.approx(value)
        assert rows[term]["standard error"] == pytest.approx(error)
        assert rows[term]["t"] == pytest.approx(value / error)
    assert sum(row["ERR [%]"] for row in summary.records) == pytest.approx(
        100 * (1 - sse / (y @ y))
    )
    aic, bic = 40 * np.log(sse / 40) + 4, 40 * np.log(sse / 40) + 2 * np.log(40)
    assert f"AIC {aic:.6g}, BIC {bic:.6g}" in repr(summary)
    assert repr(summary).count("n = 40 training samples") == repr(summary).count("AIC") == 1
    assert "<table " in summary._repr_html_()
    assert not any(": " in row["part"] for row in summary.records), "one output needs no name"
    (equation,) = [note for note in summary.notes if note.startswith("In physical units")]
    assert equation.endswith(model.equations[0].text)
    by_curve = replace(model.spec.fit, weight="curve")
    weighed = replace(model, spec=model.spec.model_copy(update={"fit": by_curve}))
    assert "AIC and BIC are left out" in repr(weighed.summary())
    flat = mm.fit({"x": x, "y": y - 3 * x}, **model.study.document | {"data": {}})
    assert any(
        "Not distinguishable from zero" in note and "x of" in note for note in flat.summary().notes
    )
    falling = mm.fit({"x": x, "y": y - 6 * x}, **model.study.document | {"data": {}})
    assert not any("Not distinguishable from zero" in note for note in falling.summary().notes)
    document = model.study.document
    robust = document | {"data": {}, "fit": document["fit"] | {"loss": "huber"}}
    notes = mm.fit({"x": x, "y": y}, **robust).summary().notes
    assert any("AIC and BIC are left out" in note for note in notes)
    assert not any("BIC " in note and "BIC are" not in note for note in notes)
    assert any("Standard errors are lower bounds" in note for note in notes)


@pytest.mark.parametrize(
    ("change", "kind", "message"),
    [
        ({"segmnt": {}}, SpecError, "did you mean `segment`"),
        ({"levls": {}}, SpecError, "did you mean `levels`"),
        (dict.fromkeys("fedcba"), SpecError, "unknown key `a`"),
        (
            {"frame": {**FRAME, "eps": np.where(np.arange(125) == 17, np.nan, EPS)}},
            DataError,
            "the frame, row 17 .from 0., column 'eps': the value of strain is missing",
        ),
        ({"columns": {"force": {"column": "G"}}}, DataError, "no column 'G'"),
        ({"columns": {"force": {"unit": "N"}}}, SpecError, "does not name its column"),
        ({"split": {"validate": {"pressure": [1000]}}}, DataError, "no level"),
        ({"frame": {**FRAME, "eps": 100 * EPS}}, SpecError, "probably in per cent"),
    ],
)
def test_mistakes_are_told_with_remedies(change, kind, message):
    with pytest.raises(kind, match=message) as raised:
        mm.fit(**{"frame": FRAME, **SECTIONS, **change})
    assert "/tmp" not in str(raised.value)


@pytest.mark.parametrize("table", [[], 7, [FRAME, "a.csv"]])
def test_what_is_no_table(table):
    with pytest.raises(SpecError):
        mm.fit(table, **SECTIONS)


def test_a_file_is_a_table_too(tmp_path):
    path = tmp_path / "log.csv"
    write_columns(path, ",".join(FRAME), *FRAME.values(), fmt="%.17g")
    assert mm.fit(path, **SECTIONS).scores.of_model() == mm.fit(FRAME, **SECTIONS).scores.of_model()
    assert expand("log.csv", tmp_path)
    assert [_reader_of(f"log.{suffix}") for suffix in ("lvm", "csv", "odd")] == [
        "lvm",
        "csv",
        "csv",
    ]
