"""A campaign of 24 runs on one process and on two."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from timing import seconds

CONFIGS = Path(__file__).parents[2] / "configs" / "m2"
ROUNDS = 2


def batch(folder, rounds=ROUNDS):
    """Seconds of the campaign, start-up and page included; the better of a few rounds, in turns, so
    that a busy moment hits both alike.
    """
    campaign = Path(folder) / "batch.yaml"
    campaign.write_text(campaign_of(os.path.relpath(CONFIGS, folder)), encoding="utf-8")
    took = {1: [], 2: []}
    for _ in range(rounds):
        for jobs, found in took.items():
            runs = Path(folder) / f"runs-{jobs}"
            shutil.rmtree(runs, ignore_errors=True)
            found.append(seconds(lambda runs=runs, jobs=jobs: run(campaign, runs, jobs)))
    names = sorted(path.parent.name for path in (Path(folder) / "runs-1").glob("*/scores.json"))
    scores = [
        [(Path(folder) / f"runs-{jobs}" / name / "scores.json").read_bytes() for name in names]
        for jobs in took
    ]
    return {
        "runs": len(names),
        "same_scores": scores[0] == scores[1],
        "one_process": min(took[1]),
        "two_processes": min(took[2]),
    }


def run(campaign, runs, jobs):
    command = [
        sys.executable,
        "-m",
        "mapmore_cli",
        "batch",
        campaign,
        "--runs",
        runs,
        "--jobs",
        str(jobs),
        "--quiet",
    ]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


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
