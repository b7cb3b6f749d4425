"""Write the tables of docs/papers/tables that claims and explanations ask for, and that no run has:

    python docs/papers/paper_tables.py [NAME ...] [--runs DIR]

Plain least squares on the samples of runs, which are brought up to date first.
"""

from __future__ import annotations

import argparse
import csv
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from our_numbers import Cell, Runs, csv_rows, result_file

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
TABLES = HERE / "tables"

Found = Iterator[Sequence[Cell]]
Columns = Mapping[str, Any]


def rms(errors: Any) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(np.square(errors))))


def curves_of(run: Path) -> tuple[str, list[Any]]:
    """Return the name of the target and the curves of a run."""
    dataset = result_file(run / "ingest.h5")
    return dataset["target"], dataset["curves"]


def polynomials(runs: Runs) -> Found:
    """Fit M1's polynomial by plain least squares in scaled inputs, with all 21 terms and with the
    pressure linear, at the held-out pressure within and beyond the strains of the pressure below.
    """
    yield "muscle and terms", "rank", "train [N]", "held out [N]", "within [N]", "beyond [N]"
    for muscle, study, below in (
        ("McKibben", "dmsp-20-88-m1-static", 150.0),
        ("Peano", "peano-m1-static", 200.0),
    ):
        target, curves = curves_of(runs.run_dir(f"configs/m1/{study}.yaml"))
        reach = next(
            float(one["columns"]["strain"].max()) for one in curves if one["level"] == below
        )
        for name, order in (("21 terms", 5), ("11 terms, pressure linear", 1)):
            powers = [(i, j) for i in range(order + 1) for j in range(6 - i)]

            def columns(curve: Any, powers: Any = powers) -> Any:
                p, e = curve["columns"]["pressure"] / 350, curve["columns"]["strain"] / 0.2
                return np.column_stack([p**i * e**j for i, j in powers])

            train = [one for one in curves if not one["held_out"].any()]
            (held,) = (one for one in curves if one["held_out"].any())
            matrix = np.concatenate([columns(one) for one in train])
            force = np.concatenate([one["columns"][target] for one in train])
            weights, _, rank, _ = np.linalg.lstsq(matrix, force, rcond=1e-9)
            wrong = columns(held) @ weights - held["columns"][target]
            within = held["columns"]["strain"] <= reach
            parts = (
                rms(matrix @ weights - force),
                rms(wrong),
                rms(wrong[within]),
                rms(wrong[~within]),
            )
            yield f"{muscle}: {name}", int(rank), *parts


def boundaries(runs: Runs) -> Found:
    """Measure how far the nearest boundary of M1's gradient segmentation is from the greatest
    hysteresis of each training curve, as a share of its strains.
    """
    yield "muscle and curve", "greatest at", "nearest boundary at", "distance [%]"
    for muscle in ("dmsp-20-88", "peano"):
        run = runs.run_dir(f"configs/m1/{muscle}-m1-hysteresis.yaml")
        rows = csv_rows(run / "report" / "tables" / "segments.csv")
        ends = [(str(row[0]).partition("/")[0], float(str(row[3]))) for row in rows.cells]
        target, curves = curves_of(run)
        for curve in curves:
            own = [end for name, end in ends if name == curve["id"]][:-1]
            if own:
                strain = curve["columns"]["strain"]
                peak = float(strain[np.argmax(curve["columns"][target])])
                near = min(own, key=lambda end: abs(end - peak))
                yield f"{muscle} {curve['id']}", peak, near, 100 * abs(near - peak) / np.ptp(strain)


def plateaus(runs: Runs) -> Found:
    """Say what swings on the plateau of the recording that was held out: deviation and strongest
    frequency; and how far the force goes beyond its mean there before it comes to rest.
    """
    yield "study and model", "swing [N]", "frequency [Hz]", "overshoot [%]"
    for study, level in (
        ("dmsp-20-88-damping", 250.0),
        ("dmsp-20-88-dynamic", 250.0),
        ("peano-damping", 350.0),
        ("peano-dynamic", 350.0),
    ):
        run = runs.run_dir(f"configs/m2/{study}.yaml")
        target, curves = curves_of(run)
        predictions = result_file(run / "validate.h5")["predictions"]
        (place,) = (i for i, one in enumerate(curves) if one["level"] == level)
        time, on = curves[place]["columns"]["time"], curves[place]["at_rest"].astype(bool)
        models = {name: values[place] for name, values in predictions.items()}
        for name, values in {"measured": curves[place]["columns"][target], **models}.items():
            rest = values[on] - values[on].mean()
            power = np.abs(np.fft.rfft(rest * np.hanning(on.sum()), 16 * on.sum())) ** 2
            hertz = np.fft.rfftfreq(16 * on.sum(), float(np.median(np.diff(time))))
            power[hertz < 1.0] = 0.0  # what creeps does not swing
            frequency = float(hertz[np.argmax(power)]) if rest.std() > 1e-9 else None
            peak = float(values[time <= time[on][0] + 0.5].max())
            beyond = 100 * (peak / float(values[on].mean()) - 1) if "dynamic" in study else None
            yield f"{study}: {name}", float(rest.std()), frequency, beyond


def sensors(runs: Runs) -> Found:
    """Compare the deviation of the damping force on the plateau that was held out, with the
    pressure before the tube and in the muscle, while both call it the plateau.
    """
    yield "muscle", "before the tube [N]", "in the muscle [N]", "share"
    for muscle, level in (("dmsp-20-88", 250.0), ("peano", 350.0)):
        records = []
        for column in ("P", "Pm"):
            study = f"configs/m2/{muscle}-damping.yaml"
            name = f"{muscle}-damping-by-{column}"
            found = {"name": name, "validate.against": ["none"], "report.published": None}
            run = runs.run_dir(study, **found, **{"data.columns.pressure.column": column})
            target, curves = curves_of(run)
            (held,) = (one for one in curves if one["level"] == level)
            time, on = held["columns"]["time"], held["at_rest"].astype(bool)
            records.append((time, held["columns"][target], time[on][0], time[on][-1]))
        first, last = max(one[2] for one in records), min(one[3] for one in records)
        swings = [
            float(force[(time >= first) & (time <= last)].std()) for time, force, *_ in records
        ]
        yield muscle, *swings, swings[1] / swings[0]


def products(_runs: Runs) -> Found:
    """Fit H's record by cubics of length, velocity and pressure: a sum of single functions, and all
    products up to the third order; blocks of eight seconds held out in turn.
    """
    yield "muscle", "sum of single functions [N]", "with products [N]"
    for muscle in ("22cm", "16cm", "12cm"):
        files = sorted((ROOT / "datasets" / "muscle-like").glob(f"random_velocity_{muscle}_*.csv"))
        rows = np.concatenate([np.loadtxt(one, delimiter=",", skiprows=1) for one in files])
        held = (rows[:, 0] >= 8) & (rows[:, 0] // 8 % 2 == 1)
        scaled = [rows[:, column] / np.abs(rows[:, column]).max() for column in (3, 4, 1)]
        single = [x**n for x in scaled for n in (1, 2, 3)]
        every = [(i, j, k) for i in range(4) for j in range(4 - i) for k in range(4 - i - j)]
        joint = [scaled[0] ** i * scaled[1] ** j * scaled[2] ** k for i, j, k in every]
        errors = []
        for terms in ([np.ones(len(rows)), *single], joint):
            matrix = np.column_stack(terms)
            weights = np.linalg.lstsq(matrix[~held], rows[~held, 2], rcond=None)[0]
            errors.append(rms(matrix[held] @ weights - rows[held, 2]))
        yield muscle, *errors


def pulls(runs: Runs) -> Found:
    """Evaluate H's formula with the printed and with our parameters: the greatest force among the
    lengths and pressures of our record at rest, and the length at which it pulls 50 N at 400 kPa.
    """
    heads = (
        "printed, greatest force [N]",
        "ours [N]",
        "ratio",
        "printed, 50 N at [mm]",
        "ours [mm]",
    )
    yield "muscle", *heads
    for printed in csv_rows(HERE / "published" / "h_table_1.csv").cells:
        muscle, *numbers = printed[:8]
        study = str(printed[-1])
        table = csv_rows(
            runs.run_dir(f"configs/muscle-like/{study}.yaml") / "report/tables/formulas.csv"
        )
        rows = table.kept({"formula": "muscle_like", "role": "backbone"})
        ours = {str(row["parameter"]): float(str(row["value"])) for row in rows}
        names = ("F", "a0", "a1", "a2", "b0", "c0", "c1")
        theirs = dict(zip(names, (float(str(one)) for one in numbers), strict=True))
        files = sorted(
            (ROOT / "datasets" / "muscle-like").glob(f"random_velocity_{study[-4:]}_*.csv")
        )
        record = np.concatenate([np.loadtxt(one, delimiter=",", skiprows=1) for one in files])
        found = []
        for of in (theirs, ours):
            pressures, lengths = record[:, 1], record[:, 3] / 1000
            line = np.linspace(0.0, 0.05, 5001)
            reached = line[np.argmax(muscle_like(of, 400.0, line) >= 50.0)]
            found.append((float(muscle_like(of, pressures, lengths).max()), 1000 * float(reached)))
        (a, at), (b, ours_at) = found
        yield muscle, a, b, b / a, at, ours_at


def muscle_like(of: Mapping[str, float], pressure: Any, length: Any) -> Any:
    """H eq 4-5 at rest (N), with the pressure in kPa and the length in m."""
    active = 1 + of["a0"] * length + of["a1"] * length**2 + of["a2"] * length**3
    return of["F"] * (pressure * active + of["c0"] + of["c1"] * length)


CALLS = 2_000_000
PROGRAM = """\
#include <stdio.h>
#include <time.h>
#include "%(stem)s.h"
int main(void) {
    double in[%(size)d] = {%(at)s}, out = 0, sum = 0;
    clock_t start = clock();
    for (long k = 0; k < %(calls)d; k++) { in[0] += 1e-7; %(stem)s_eval(in, &out); sum += out; }
    printf("%%.17g %%g\\n", (double)(clock() - start) / CLOCKS_PER_SEC / %(calls)d * 1e9, sum);
    return 0;
}
"""


def calls(runs: Runs) -> Found:
    """Time one prediction of the exported C (ns), by gcc -O2 on the machine of this table."""
    yield "study", "one call [ns]"
    for study, at in (
        ("dmsp-20-88-static", "250, 0.05"),
        ("peano-static", "350, 0.05"),
        ("dmsp-20-88-dynamic", "1, 250, 100, 0.05, 0.1"),
    ):
        model = runs.run_dir(f"configs/m2/{study}.yaml") / "model.h5"
        with tempfile.TemporaryDirectory() as name:
            folder, stem = Path(name), study.replace("-", "_")
            export = ("mapmore", "export", str(model), "--to", "c", "-o", name, "-q")
            subprocess.run(export, check=True, capture_output=True)
            words = {"stem": stem, "at": at, "size": len(at.split(",")), "calls": CALLS}
            (folder / "timed.c").write_text(PROGRAM % words)
            build = ("gcc", "-O2", "timed.c", f"{stem}.c", "-lm", "-o", "timed")
            subprocess.run(build, check=True, cwd=folder)
            told = subprocess.run(("./timed",), check=True, cwd=folder, capture_output=True)
            yield study, float(told.stdout.split()[0])


MADE: Mapping[str, Callable[[Runs], Found]] = {
    one.__name__: one
    for one in (polynomials, boundaries, plateaus, sensors, products, pulls, calls)
}


def rows_of(name: str, runs: Runs) -> list[list[str]]:
    """Return the headings and the rows of a table as they are written."""
    return [
        [format(cell, ".6g") if isinstance(cell, float) else str(cell or "") for cell in row]
        for row in MADE[name](runs)
    ]


def main() -> None:
    """Write the tables that the command line names, by default all."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(MADE))
    parser.add_argument("--runs", type=Path, default=Path("runs"), help="folder of the runs")
    asked = parser.parse_args()
    TABLES.mkdir(parents=True, exist_ok=True)
    for name in asked.names or MADE:
        with (TABLES / f"{name}.csv").open("w", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows(rows_of(name, Runs(asked.runs, ROOT)))


if __name__ == "__main__":
    main()
