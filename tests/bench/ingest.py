"""A long CSV log: ingested by the program, and read by others."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
from regression import PEERS_PYTHON

LINES = 100_000
READ = """
import sys, pathlib, time, importlib
read_csv = importlib.import_module(sys.argv[1]).read_csv
begun = time.process_time()
for path in sorted(pathlib.Path(sys.argv[2]).glob("*.csv")):
    read_csv(path).to_numpy()
print(time.process_time() - begun)
"""
STUDY = """
schema_version: 1
name: long-log
data: {files: [logs/long_log.csv], reader: csv, columns: {pressure: {column: P, unit: kPa},
    strain: {column: eps}, force: {column: F, unit: N}}}
target: {column: force}
dictionary: [{polynomial: {of: [pressure, strain], order: 2}}]
"""


def ingest(folder, megabytes):
    """Megabytes a second of processor time that the command ingests, and that others read; how many
    times that a whole run takes; and the peaks of memory.
    """
    logs = Path(folder) / "logs"
    logs.mkdir()
    lines = write_log(logs / "long_log.csv", megabytes)
    size = (logs / "long_log.csv").stat().st_size / 1e6
    spec = Path(folder) / "long-log.yaml"
    spec.write_text(STUDY, encoding="utf-8")
    (processor, peak), (whole, peak_of_run) = (
        usage_of(
            [sys.executable, "-m", "mapmore_cli", command, spec, "--runs", f"{folder}/{command}"]
        )
        for command in ("ingest", "run")
    )
    peers = peers_reading(logs)
    shutil.rmtree(logs)
    return {
        "megabytes": size,
        "lines": lines,
        "ingested_megabytes_per_second": size / processor,
        **{f"{name}_megabytes_per_second": size / seconds for name, seconds in peers.items()},
        "bytes_of_the_numbers": 8 * 3 * lines,
        "peak_memory_bytes": peak,
        "run_times_ingest": whole / processor,
        "peak_memory_bytes_of_run": peak_of_run,
    }


def peers_reading(folder):
    """Seconds of processor time in which others read the CSV files of a folder, imports apart; none
    of those that are not installed.
    """
    took = {}
    for name in ("pandas", "polars") if PEERS_PYTHON.exists() else ():
        done = subprocess.run(
            [PEERS_PYTHON, "-c", READ, name, folder],
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode == 0:
            took[name] = float(done.stdout)
    return took


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
