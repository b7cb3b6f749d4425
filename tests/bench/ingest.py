"""A long CSV log: parsed, and ingested by the program."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from time import perf_counter

import numpy as np
from timing import seconds

from mapmore_cli.storage.readers import READERS, TableRequest
from mapmore_cli.storage.spool import spooling_in

LINES = 100_000
STUDY = """
schema_version: 1
name: long-log
data: {files: [long_log.csv], reader: csv, columns: {pressure: {column: P, unit: kPa},
    strain: {column: eps}, force: {column: F, unit: N}}}
target: {column: force}
dictionary: [{polynomial: {of: [pressure, strain], order: 2}}]
"""


def ingest(folder, megabytes):
    """Megabytes a second of the parser alone and of the whole command, by the clock and of
    processor time, and its peak of memory.
    """
    path = Path(folder) / "long_log.csv"
    lines = write_log(path, megabytes)
    size = path.stat().st_size / 1e6
    (Path(folder) / "long-log.yaml").write_text(STUDY, encoding="utf-8")
    command = [
        sys.executable,
        "-m",
        "mapmore_cli",
        "ingest",
        Path(folder) / "long-log.yaml",
        "--runs",
        folder,
    ]
    start = perf_counter()
    processor, peak = usage_of(command)
    whole = perf_counter() - start
    with spooling_in(
        Path(folder)
        # after the command, whose peak of memory would count that of this process before it was
        # split
        # off
    ):
        parsed = seconds(lambda: READERS["csv"].read(path, TableRequest("log", ("P", "eps", "F"))))
    path.unlink()
    return {
        "megabytes": size,
        "lines": lines,
        "parsed_megabytes_per_second": size / parsed,
        "ingested_megabytes_per_second": size / whole,
        "ingested_megabytes_per_processor_second": size / processor,
        "bytes_of_the_numbers": 8 * 3 * lines,
        "peak_memory_bytes": peak,
    }


def usage_of(command):
    """Seconds of processor time and peak of memory of a command that shows its progress."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024


def write_log(path, megabytes):
    """The same lines over and over, as quick to write as the disk allows; their number."""
    rng = np.random.default_rng(2)
    pressure, strain, force = (
        rng.uniform(0, 600, LINES),
        rng.uniform(0, 0.25, LINES),
        rng.normal(300, 100, LINES),
    )
    rows = zip(pressure.tolist(), strain.tolist(), force.tolist(), strict=True)
    text = "".join(f"{p:.4f},{e:.6f},{f:.5f}\n" for p, e, f in rows).encode()
    times = -(-megabytes * 10**6 // len(text))
    with path.open("wb") as file:
        file.write(b"P,eps,F\n")
        for _ in range(times):
            file.write(text)
    return times * LINES
