"""How long others take to read CSV files: `python reading.py pandas FILE ...` prints seconds of
processor time, imports apart. It runs in the peers' environment.
"""

from __future__ import annotations

import sys
from time import process_time


def pandas(paths):
    from pandas import read_csv

    begun = process_time()
    for path in paths:
        read_csv(path).to_numpy()
    return process_time() - begun


def polars(paths):
    from polars import read_csv

    begun = process_time()
    for path in paths:
        read_csv(path).to_numpy()
    return process_time() - begun


READERS = {"pandas": pandas, "polars": polars}

if __name__ == "__main__":
    name, folder = sys.argv[1:]
    from pathlib import Path

    print(READERS[name](sorted(Path(folder).glob("*.csv"))))
