"""`make bench`: one thread, one run, medians. Prints a table and writes bench.json, whose numbers
are seconds unless named otherwise.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path

# before NumPy starts its threads
os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")

HERE = Path(__file__).parent
sys.path.append(str(HERE.parent))  # `common`, what tests share


def main():
    from exported import exported
    from ingest import ingest
    from many import (
        figures,
        long_log,
        many_files,
        many_levels,
        many_runs,
        resumed,
        sixty_inputs,
    )
    from motion import motion
    from program import evaluation, small_table, start_up
    from regression import regression
    from table import exported_lines, other_lines, regression_lines

    options = arguments()
    bench = {"machine": {"processor": platform.processor(), "python": platform.python_version()}}
    with tempfile.TemporaryDirectory() as folder:
        measures = {
            "streaming": lambda: streamed(options.samples, folder),
            "ingest": lambda: ingest(folder, options.megabytes),
            "start_up": lambda: start_up(folder),
            "evaluation": lambda: evaluation(folder),
            "small_table": lambda: small_table(folder),
            "exported": lambda: exported(folder),
            "many_files": lambda: many_files(folder, options.files),
            "many_levels": lambda: many_levels(folder),
            "long_log": lambda: long_log(folder),
            "sixty_inputs": lambda: sixty_inputs(folder),
            "resumed": lambda: resumed(folder, options.resumed),
            "many_runs": lambda: many_runs(folder, options.runs),
            "figures": lambda: figures(folder),
            "motion": motion,
            "frols": lambda: regression(say),
        }
        for name, measure in measures.items():
            if name in (options.only or measures):
                say(name)
                bench[name] = measure()
    options.output.write_text(json.dumps(bench, indent=2) + "\n", encoding="utf-8")
    print(*regression_lines(bench.get("frols", {})), *other_lines(bench), sep="\n")
    print(*exported_lines(bench.get("exported", {})), sep="\n")


def arguments():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--samples",
        type=int,
        default=100_000_000,
        help="length of the streamed record (100 million; 3.2 GB)",
    )
    parser.add_argument("--megabytes", type=int, default=1000, help="size of the CSV log (1000)")
    parser.add_argument("--files", type=int, default=5000, help="files of one study (5000)")
    parser.add_argument("--runs", type=int, default=500, help="small runs of a campaign (500)")
    parser.add_argument("--resumed", type=int, default=20_000, help="runs resumed (20 000)")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="these measurements alone")
    parser.add_argument("--output", type=Path, default=Path("bench.json"))
    return parser.parse_args()


def streamed(samples, folder):
    command = [sys.executable, HERE / "streaming.py", str(samples), folder]
    return json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout)


def say(what):
    print(f"... {what}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
