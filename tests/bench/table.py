"""What the benchmark prints: seconds, how many times our own that is, and whether the targets are
met.
"""

from __future__ import annotations

from peer import PEERS

from mapmore_cli.annexes.motion.solvers import SOLVERS

CONTESTANTS = ("ours", "dsyrk", "gram", "textbook", *PEERS)

TALL_TARGETS = {"dsyrk": 1 / 1.3, "sysidentpy": 25.0, "fastcan": 5.0}
WIDE_TARGETS = {"gram": 2.0, "sysidentpy": 10.0}
"""At least this many times our own seconds."""
MEMORY_TARGET = 0.10
SMALL_TABLE_TARGET = 5.0
"""Seconds from a table of 60 points to its page."""
SWARM_TARGET = 1.0
"""Seconds for 50 particles and 20 iterations over 20 000 samples."""


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
    streaming, ingest, evaluation, start = (
        bench["streaming"],
        bench["ingest"],
        bench["evaluation"],
        bench["start_up"],
    )
    motion = bench["motion"]
    yield (
        f"streaming   {streaming['samples']} samples, {streaming['candidates']} candidates: "
        f"{streaming['seconds']:.3g} s, "
        f"{streaming['samples_per_second']:.3g} samples/s, "
        f"{streaming['seconds_per_sample_over_in_memory']:.2f} times the in-memory "
        f"time per sample, peak {streaming['peak_memory_bytes'] / 2**20:.0f} MiB"
    )
    yield (
        f"ingest      {ingest['megabytes']:.0f} MB of CSV: "
        f"{ingest['parsed_megabytes_per_second']:.0f} MB/s parsed, "
        f"{ingest['ingested_megabytes_per_second']:.0f} MB/s ingested "
        f"({ingest['ingested_megabytes_per_processor_second']:.0f} MB in a second of "
        "processor time), "
        f"peak {ingest['peak_memory_bytes'] / 2**20:.0f} MiB "
        f"({ingest['bytes_of_the_numbers'] / 2**20:.0f} MiB of numbers)"
    )
    batch = bench["batch"]
    yield (
        f"batch       {batch['runs']} runs: {batch['one_process']:.3g} s on one process, "
        f"{batch['two_processes']:.3g} s on two, "
        f"{batch['one_process'] / batch['two_processes']:.2f} times faster"
    )
    yield (
        f"evaluation  {evaluation['points']} points: {evaluation['fused_model']:.3g} s, "
        f"{evaluation['evaluations_per_second']:.3g} a second, "
        f"{evaluation['fused_model'] / evaluation['active_terms']:.1f} times its active terms "
        "on sorted rows "
        f"({evaluation['active_terms_per_point']:.2f} a point)"
    )
    yield (
        f"motion      {motion['simulations']} simulations of {motion['samples']} samples: "
        f"{motion['filter']:.3g} s "
        f"({'met' if motion['filter'] < SWARM_TARGET else 'MISSED'}), by a loop "
        f"{motion['loop'] / motion['filter']:.0f} times as long; "
        + ", ".join(f"{name} {motion[name]:.3g} s" for name in SOLVERS)
    )
    small = bench["small_table"]
    yield (
        f"small table {small['points']} points: init {small['init']:.2f} s and run "
        f"{small['run']:.2f} s "
        f"({'met' if small['init'] + small['run'] < SMALL_TABLE_TARGET else 'MISSED'})"
    )
    yield (
        f"start-up    mapmore --version {start['version']:.2f} s (Python alone "
        f"{start['python']:.2f}), "
        f"a run {start['first_run']:.2f} s, up to date {start['run_up_to_date']:.2f} s, a "
        f"check {start['check']:.2f} s "
        f"(NumPy, pydantic and Typer alone {start['libraries']:.2f})"
    )
