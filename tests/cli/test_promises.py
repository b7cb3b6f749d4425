"""What a run promises: nothing chosen on held-out data, nothing done twice, the same bytes for the
same input.
"""

from __future__ import annotations

import hashlib
import json
import locale
import time
from contextlib import suppress
from typing import Any

import h5py
import numpy as np
from cli_samples import change_forces, write_study

LATER = ["fuse", "validate", "report"]


def arrays(path):
    found: dict[str, np.ndarray] = {}
    with h5py.File(path) as file:
        file.visititems(
            lambda name, node: (
                found.update({name: node[()]}) if isinstance(node, h5py.Dataset) else None
            )
        )
    return found


def test_permuted_held_out_forces_leave_the_model_unchanged(tmp_path, mapmore):
    for settings in (
        [],
        ["--set", "model.backbone=sarosi", "--set", "fit.max_terms=3", "--set", "fit.stop=bic"],
    ):
        folder = tmp_path / str(len(settings))
        folder.mkdir()
        spec = write_study(folder)
        model = folder / "runs" / "bench" / "model.h5"
        mapmore("run", spec, "--runs", folder / "runs", "-q", *settings, code=0)
        before, scores = arrays(model), (model.parent / "scores.json").read_bytes()
        change_forces(folder / "bench_200.csv", np.random.default_rng(0).permutation)
        mapmore("run", spec, "--runs", folder / "runs", "-q", *settings, code=0)
        after = arrays(model)
        np.testing.assert_equal(after, before)
        assert (model.parent / "scores.json").read_bytes() != scores


def stages(mapmore, spec, runs, *more):
    result = mapmore("run", spec, "--runs", runs, "--json", "-q", *more, code=0)
    return dict(json.loads(result.stdout)["stages"])


def test_a_change_redoes_what_depends_on_it_and_says_why(copied, tmp_path, mapmore):
    spec, runs = copied
    assert set(stages(mapmore, spec, runs).values()) == {"up-to-date"}
    explained = mapmore("run", spec, "--runs", runs, "--explain", "--set", "fuse.z_s=0.4").stdout
    assert "fuse.z_s: 0.25 -> 0.4" in explained
    again = stages(mapmore, spec, runs, "--set", "fuse.z_s=0.4")
    assert [stage for stage, status in again.items() if status == "done"] == LATER
    (tmp_path / "bench_300.csv").write_text(
        (tmp_path / "bench_300.csv").read_text().replace("300,", "300.5,")
    )
    assert (
        "bench_300.csv"
        in mapmore("run", spec, "--runs", runs, "--explain", "--set", "fuse.z_s=0.4").stdout
    )
    assert set(stages(mapmore, spec, runs, "--set", "fuse.z_s=0.4").values()) == {"done"}


def test_the_same_input_gives_the_same_bytes(copied, mapmore):
    spec, before = copied
    again = before.with_name("again")
    assert set(stages(mapmore, spec, again).values()) == {"done"}
    digests = []
    for runs in (before, again):
        files = sorted(
            path
            for path in (runs / "bench").rglob("*")
            if path.is_file() and path.name not in ("run.json", ".lock")
        )
        digests.append(
            {
                path.relative_to(runs).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
                for path in files
            }
        )
    assert digests[0] == digests[1]
    assert "bench/scores.json" in digests[0]


def test_a_backbone_that_says_it_all_is_kept_alone(tmp_path, mapmore):
    """The data are a plane: polynomial_2 has it, and a residual of noise must not help on left-out
    levels.
    """
    spec, runs = write_study(tmp_path), tmp_path / "runs"
    result = mapmore(
        "run",
        spec,
        "--runs",
        runs,
        "--set",
        "model.backbone=polynomial_2",
        "--set",
        "fit.max_terms=3",
        code=0,
    )
    shown = json.loads(mapmore("show", runs / "bench" / "model.h5", "--json").stdout)
    rows = {
        row["model"]: row
        for row in json.loads((runs / "bench" / "scores.json").read_text())["scores"]
        if row["split"] == "validate"
    }
    assert "keeps polynomial_2 alone" in result.stderr
    assert shown["segments"] == []
    assert rows["mapmore"]["rmse"] == rows["polynomial_2"]["rmse"]


def test_order_of_rows_names_of_files_threads_and_time_zone_do_not_matter(
    tmp_path, mapmore, monkeypatch
):
    """Nor does the language: numbers are read and written in one way everywhere."""
    from threadpoolctl import threadpool_limits

    found: list[tuple[bytes, list[Any]]] = []
    before = locale.setlocale(locale.LC_ALL)
    for place in ("plain", "other"):
        folder = tmp_path / place
        folder.mkdir()
        spec = write_study(folder)
        if place == "other":
            rng = np.random.default_rng(3)
            for number, level in zip("3x1", (100, 200, 300), strict=True):
                head, *rows = (folder / f"bench_{level}.csv").read_text().splitlines()
                (folder / f"bench_{number}.csv").write_text(
                    "\n".join([head, *rng.permutation(rows)]) + "\n"
                )
                (folder / f"bench_{level}.csv").unlink()
            monkeypatch.setenv("TZ", "Pacific/Kiritimati")
            time.tzset()
            for language in ("de_DE.UTF-8", "C.UTF-8", ""):
                with suppress(locale.Error):
                    locale.setlocale(locale.LC_ALL, language)
                    break
        try:
            with threadpool_limits(2 if place == "other" else 1):
                mapmore("validate", spec, "--runs", folder / "runs", "-q", code=0)
        finally:
            locale.setlocale(locale.LC_ALL, before)
        shown = json.loads(mapmore("show", folder / "runs" / "bench" / "fit.h5", "--json").stdout)
        found.append(
            (
                (folder / "runs" / "bench" / "scores.json").read_bytes(),
                [segment["terms"] for segment in shown["segments"]],
            )
        )
    monkeypatch.undo()
    time.tzset()
    assert found[0] == found[1]
