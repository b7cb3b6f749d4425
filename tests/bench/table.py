"""What the benchmark prints: seconds, how many times our own that is, and whether the targets are
met.
"""

from __future__ import annotations

from peer import PEERS

CONTESTANTS = ("ours", "dsyrk", "gram", "textbook", *PEERS)

TALL_TARGETS = {"dsyrk": 1 / 1.3, "sysidentpy": 25.0, "fastcan": 5.0}
WIDE_TARGETS = {"gram": 2.0, "sysidentpy": 10.0}
"""At least this many times our own seconds."""
MEMORY_TARGET = 0.10
TARGETS = {
    "ingest": (2.5, lambda row: row["run_times_ingest"]),
    "motion": (1.0, lambda row: row["filter"]),
    "small_table": (5.0, lambda row: row["init"] + row["run"]),
    "many_files": (30.0, lambda row: row["run"]),
    "many_levels": (6.0, lambda row: row["2000"]),
    "long_log": (1000.0, lambda row: row["memory"] / 1e6),
    "sixty_inputs": (10.0, lambda row: row["run"]),
    "resumed": (60.0, lambda row: row["again"]),
    "many_runs": (0.5, lambda row: row["each"]),
    "figures": (2.5, lambda row: row["figures"]),
}
"""A whole run of a long log, in times of its ingest; and seconds: of 50 particles and 20 iterations
over 20 000 samples, from a table of 60 points to its page, of 5000 files, of 2000 levels, of sixty
inputs, of 20 000 runs that are up to date, of a small run, of the figures of a page. Of a log of
ten million rows it is megabytes of memory.
"""


def regression_lines(table):
    yield (
        f"{'seconds (times ours)':22}"
        + "".join(f"{name:>18}" for name in CONTESTANTS)
        + f"{'extra memory':>16}"
    )
    for shape, row in table.items():
        cells = (_cell(row, name) for name in CONTESTANTS)
        yield (
            f"{shape:22}"
            + "".join(f"{cell:>18}" for cell in cells)
            + f"{row['extra_memory_ratio']:>15.1%}"
            + " "
        )
    for shape, row in table.items():
        yield f"{shape:22}{'; '.join(_verdicts(shape, row))}"
        yield from (f"note: {shape}: {peer}: {note}" for peer, note in row["notes"].items())


def _cell(row, name):
    if row[name] is None:
        return "-"
    return (
        f"{row[name]:.4g}" if name == "ours" else f"{row[name]:.4g} ({row[name] / row['ours']:.3g})"
    )


def _verdicts(shape, row):
    n, M, _ = (int(number) for number in shape.split("x"))
    wide = n < 10 * M
    for name, least in (WIDE_TARGETS if wide else TALL_TARGETS).items():
        if row[name] is None:
            yield f"{name}: not measured"
        else:
            factor = row[name] / row["ours"]
            yield (
                f"{name} {factor:.2f} times ours, at least {least:.2f} wanted: "
                f"{'met' if factor >= least else 'MISSED'}"
            )
    if not wide:
        yield f"memory: {'met' if row['extra_memory_ratio'] < MEMORY_TARGET else 'MISSED'}"


def exported_lines(rows):
    """The table of docs/export.md."""
    yield (
        "| model | C, ns a call | NumPy, ns a sample of 5000 | NumPy, ns a call | code, bytes "
        "| state, bytes |"
    )
    yield "|---|---:|---:|---:|---:|---:|"
    for what, row in rows.items():
        many = "-" if row["numpy_many"] is None else f"{row['numpy_many']:.0f}"
        yield (
            f"| {what} | {row['c']:.1f} | {many} | {row['numpy_one']:.0f} | {row['code']} | "
            f"{row['state']} |"
        )


def other_lines(bench):
    """A line for each of the other measurements, and what was wanted of some of them."""
    for what, numbers in bench.items():
        if what not in ("machine", "frols", "exported"):
            words = ", ".join(f"{name} {value:.4g}" for name, value in numbers.items())
            yield f"{what:12}{words}"
    for what, (most, seconds) in TARGETS.items():
        if what in bench:
            took = seconds(bench[what])
            yield f"{what:12}{took:.3g} of {most:g}: {'met' if took < most else 'MISSED'}"
