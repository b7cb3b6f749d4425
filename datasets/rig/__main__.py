"""Write the recordings of a simulation: `python -m datasets.rig SPEC -o DIR --set KEY=VALUE`."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from datasets.rig.simulate import SimulationSpec, simulate
from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.study.loader import load_as


def main() -> int:
    """Simulate the campaign of the command line and return the exit code of its error, or 0."""
    parser = argparse.ArgumentParser(prog="python -m datasets.rig", description=__doc__)
    parser.add_argument("spec", type=Path, help="the simulation (YAML)")
    parser.add_argument("-o", "--output", type=Path, help="where to; by default beside SPEC")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--force", action="store_true", help="replace recordings that exist")
    asked = parser.parse_args()
    try:
        loaded = load_as(asked.spec, SimulationSpec, asked.set)
        folder = asked.output or loaded.folder
        for path in simulate(loaded.spec, folder, lambda *_: None, asked.force):
            print(path)
    except MapmoreError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main())
