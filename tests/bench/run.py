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


def main():
    from batch import batch
    from exported import exported
    from ingest import ingest
    from motion import motion
    from program import evaluation, small_table, start_up
    from regression import regression
    from table import exported_lines, other_lines, regression_lines

    options = arguments()
    with tempfile.TemporaryDirectory() as folder:
        say("streaming")
        bench = {
            "machine": {"processor": processor(), "python": platform.python_version(), "threads": 1}
        }
        bench["streaming"] = streamed(options.samples, folder)
        say("ingest")
        bench["ingest"] = ingest(folder, options.megabytes)
        say("start-up and evaluation")
        bench["start_up"] = start_up(folder)
        bench["evaluation"] = evaluation(folder)
        bench["small_table"] = small_table(folder)
        say("exported models")
        bench["exported"] = exported(folder)
        say("24 runs on one process and on two")
        bench["batch"] = batch(folder)
        say("models of motion")
        bench["motion"] = motion()
        bench["frols"], bench["notes"] = regression(say)
    options.output.write_text(json.dumps(bench, indent=2) + "\n", encoding="utf-8")
    print(*regression_lines(bench["frols"]), *other_lines(bench), sep="\n")
    print(*exported_lines(bench["exported"]), sep="\n")
    for what, note in bench["notes"].items():
        print(f"note: {what}: {note}")


def arguments():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--samples",
        type=int,
        default=100_000_000,
        help="length of the streamed record (100 million; 3.2 GB)",
    )
    parser.add_argument("--megabytes", type=int, default=1000, help="size of the CSV log (1000)")
    parser.add_argument("--output", type=Path, default=Path("bench.json"))
    return parser.parse_args()


def streamed(samples, folder):
    command = [sys.executable, HERE / "streaming.py", str(samples), folder]
    return json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout)


def processor():
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next(
        (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")),
        platform.processor(),
    )


def say(what):
    print(f"... {what}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
