"""A record that is fitted as it is read: `python streaming.py 100000000 FOLDER` prints its result
as JSON, and progress on stderr.

A process of its own, since it reports its own peak of memory.
"""

from __future__ import annotations

import json
import resource
import shutil
import sys
from itertools import combinations_with_replacement
from pathlib import Path
from time import perf_counter

import h5py
import numpy as np
from timing import median_seconds

from mapmore_cli.cli.progress import Reporter
from mapmore_cli.modelling.expressions import dictionary_blocks, dictionary_matrix, parse
from mapmore_cli.modelling.frols import Regression, frols, frols_together

INPUTS = ("a", "b", "c")
TERMS = [
    parse("*".join(term) or "1")
    for degree in range(5)
    for term in combinations_with_replacement(INPUTS, degree)
]
CHUNK = 65_536
BYTES_PER_SAMPLE = 8 * (len(INPUTS) + 1)
WHOLE = 5_000_000
"""Samples of the part that is fitted in memory as well."""
MAX_TERMS = 8


def write_record(path, samples):
    rng = np.random.default_rng(1)
    with h5py.File(path, "w") as file:
        stored = {
            name: file.create_dataset(name, samples, "f8", chunks=(min(CHUNK, samples),))
            for name in (*INPUTS, "y")
        }
        for start in range(0, samples, CHUNK):
            rows = slice(start, min(start + CHUNK, samples))
            a, b, c = values = rng.uniform(-1, 1, (3, rows.stop - start))
            y = (
                a * b
                - c**3 / 2
                + a**2 * b * c
                - b**3 * c / 2
                + 0.3 * a**2
                + 0.2 * b * c
                + 0.1 * a
                + 0.1
            )
            y += 0.05 * rng.standard_normal(a.size)
            for name, column in zip((*INPUTS, "y"), (*values, y), strict=True):
                stored[name][rows] = column


def blocks_of(path, samples, progress):
    """The dictionary of 35 terms, built from one chunk of the record after the other."""

    def blocks():
        with h5py.File(path) as file:
            for start in range(0, samples, CHUNK):
                progress("samples", start, samples)
                here = slice(start, min(start + CHUNK, samples))
                y = file["y"][here]
                for rows, P in dictionary_blocks(
                    TERMS, {name: file[name][here] for name in INPUTS}, len(y)
                ):
                    yield P, y[rows]

    return blocks


def fit_in_memory(path, samples):
    with h5py.File(path) as file:
        columns = {name: file[name][:samples] for name in INPUTS}
        return frols(dictionary_matrix(TERMS, columns, samples), file["y"][:samples], MAX_TERMS)


def main(samples, folder):
    path = Path(folder) / "record.h5"
    free = shutil.disk_usage(folder).free
    if free < 1.1 * samples * BYTES_PER_SAMPLE:
        sys.exit(
            f"{samples} samples take {samples * BYTES_PER_SAMPLE / 1e9:.1f} GB, {folder} has "
            f"{free / 1e9:.1f} GB left: say --samples"
        )
    write_record(path, samples)
    with Reporter() as reporter:
        start = perf_counter()
        problem = Regression(blocks_of(path, samples, reporter.progress))
        (streamed,) = frols_together([problem], MAX_TERMS)
        elapsed = perf_counter() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    part = min(WHOLE, samples)
    whole = fit_in_memory(path, part)
    # on pages that the first one made the system hand out
    whole_seconds = median_seconds(lambda: fit_in_memory(path, part), 3)
    result = {
        "samples": samples,
        "candidates": len(TERMS),
        "terms": len(streamed.chosen),
        "seconds": elapsed,
        "samples_per_second": samples / elapsed,
        "peak_memory_bytes": peak,
        "in_memory_samples": part,
        "seconds_per_sample_over_in_memory": elapsed / samples / (whole_seconds / part),
        "same_terms": sorted(streamed.chosen.tolist()) == sorted(whole.chosen.tolist()),
    }
    path.unlink()
    print(json.dumps(result))


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
