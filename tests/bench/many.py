"""Many files in one study, many small runs in one campaign, and the figures of a page; seconds are
of processor time.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
from ingest import peers_reading, usage_of
from program import STUDY

ROWS = 60
LEVELS = (100, 200, 300, 400, 500)
SPEC = """
schema_version: 1
name: many-files
data: {files: [many/*.csv], reader: csv, columns: {pressure: {column: P, unit: kPa},
    strain: {column: eps}, force: {column: F, unit: N}}, levels: {of: pressure, at: [LEVELS]},
    split: {validate: {pressure: [300]}}}
target: {column: force}
dictionary: [{polynomial: {of: [strain], order: 2}}]
"""


def mapmore(*arguments):
    return usage_of([sys.executable, "-m", "mapmore_cli", *map(str, arguments), "-q"])[0]


def many_files(folder, count):
    """A study of so many files of 60 rows, beside one of a tenth of them, and beside what only
    reads them.
    """
    took = {}
    for files in (count // 10, count):
        place = Path(folder) / f"many-{files}"
        write_files(place / "many", files)
        spec = place / "many.yaml"
        levels = ", ".join(map(str, LEVELS))
        spec.write_text(SPEC.replace("LEVELS", levels), encoding="utf-8")
        took[files] = mapmore("run", spec, "--runs", place)
    some, every = took.values()
    peers = peers_reading(place / "many")
    return {"files": count, "run": every, "a_tenth_of_them": some, **peers}


def write_files(folder, count):
    """A stroke and back at one of five pressures in each file, with noise of its own."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(3)
    strain = 0.12 * (1 - np.cos(np.linspace(0, 2 * np.pi, ROWS)))
    for number in range(count):
        pressure = LEVELS[number % len(LEVELS)]
        force = pressure * (1 - 4 * strain) + 50 * strain + rng.normal(0, 1, ROWS)
        rows = zip(strain.tolist(), force.tolist(), strict=True)
        text = "".join(f"{pressure},{e:.6f},{f:.4f}\n" for e, f in rows)
        (folder / f"r{number:05d}.csv").write_text(f"P,eps,F\n{text}", encoding="utf-8")


def many_runs(folder, count):
    """A campaign of about so many small runs without their pages, in one process."""
    widths = -(-count // 8)
    campaign = Path(folder) / "many-runs.yaml"
    configs = os.path.relpath(STUDY.parent, folder)
    campaign.write_text(campaign_of(configs, widths), encoding="utf-8")
    runs = Path(folder) / "many-runs"
    seconds = mapmore("batch", campaign, "--runs", runs, "--jobs", 1, "--no-pages")
    alone = mapmore("run", STUDY, "--runs", Path(folder) / "alone")
    return {"runs": 8 * widths, "each": seconds / (8 * widths), "one_by_itself_with_page": alone}


def campaign_of(configs, widths=3):
    """Two muscles with one to four terms and so many widths of the transition."""
    runs = [
        f"  - {{base: {configs}/{study}.yaml, name: {study}-{terms}-{width}, set: "
        f"{{fit.max_terms: {terms}, fuse.z_s: {width / (3 * widths)}}}}}"
        for study in ("dmsp-20-88-static", "peano-static")
        for terms in (1, 2, 3, 4)
        for width in range(1, widths + 1)
    ]
    return "\n".join(["schema_version: 1", "campaign: batch", "title: runs", "runs:", *runs, ""])


def figures(folder):
    """The page of M2's static study with all of its figures, and without any."""
    runs = Path(folder) / "figures"
    mapmore("validate", STUDY, "--runs", runs)
    page = {
        names: mapmore("report", STUDY, "--runs", runs, "--figures", names)
        for names in ("none", "all")
    }
    return {"figures": page["all"] - page["none"], "without": page["none"]}
