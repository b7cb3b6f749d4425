"""What a run promises: the same bytes for the same input, whatever surrounds it."""

import locale
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
from cli_samples import scored_run, write_lines


def test_the_same_input_gives_the_same_bytes(copied, mapmore):
    """But for the record of the run and the page of all runs, which have the time."""
    spec, runs = copied
    before = runs.rename(runs.with_name("before"))
    assert set(scored_run(mapmore, spec, "--runs", runs)[1].values()) == {"done"}
    one, other = (
        {
            path.relative_to(made): path.read_bytes()
            for path in made.rglob("*")
            if path.is_file() and path.name not in ("run.json", ".lock")
        }
        for made in (before, runs)
    )
    assert one.pop(Path("index.html")) != other.pop(Path("index.html"))
    assert one == other
    assert {Path("bench", "scores.json"), Path("bench", "report", "index.html")} <= one.keys()


def test_order_of_rows_names_of_files_threads_and_time_zone_do_not_matter(
    study, tmp_path, document, monkeypatch
):
    """Nor does the language: numbers are read and written in one way everywhere."""
    from threadpoolctl import threadpool_limits

    def found(threads):
        with threadpool_limits(threads):
            document("validate", study, "-q")
        shown = document("show", "runs/bench/fit.h5")
        scores = Path("runs", "bench", "scores.json").read_bytes()
        return scores, [segment["terms"] for segment in shown["segments"]]

    plain = found(1)
    rng, before = np.random.default_rng(3), locale.setlocale(locale.LC_ALL)
    for number, level in zip("3x1", (100, 200, 300), strict=True):
        path = tmp_path / f"bench_{level}.csv"
        head, *rows = path.read_text().splitlines()
        write_lines(tmp_path / f"bench_{number}.csv", head, *rng.permutation(rows))
        path.unlink()
    monkeypatch.setenv("TZ", "Pacific/Kiritimati")
    time.tzset()
    for language in ("de_DE.UTF-8", "C.UTF-8", ""):
        with suppress(locale.Error):
            locale.setlocale(locale.LC_ALL, language)
            break
    try:
        assert found(2) == plain
    finally:
        locale.setlocale(locale.LC_ALL, before)
        monkeypatch.undo()
        time.tzset()
