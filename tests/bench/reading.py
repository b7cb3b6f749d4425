"""How long others take to read the CSV files of a folder: `python reading.py pandas FOLDER` prints
seconds of processor time, imports apart. It runs in the peers' environment.
"""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from time import process_time

READERS = ("pandas", "polars")

if __name__ == "__main__":
    name, folder = sys.argv[1:]
    read_csv = import_module(name).read_csv
    begun = process_time()
    for path in sorted(Path(folder).glob("*.csv")):
        read_csv(path).to_numpy()
    print(process_time() - begun)
