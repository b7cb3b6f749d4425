"""Write the table of docs/scale.md: `python docs/scale_tables.py`; with a folder of runs, its
finished runs are recorded first.

The runs of a campaign are replayed: the seconds, files and megabytes of real ones, over and over,
on so many workers that share one client and one file system.
"""

from __future__ import annotations

import csv
import heapq
import json
import time
from argparse import ArgumentParser
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import cycle, islice
from pathlib import Path

from pages import CONFIGS, write_tables

from mapmore_cli.reporting.table import Table
from mapmore_cli.study.loader import load

DOCS = Path(__file__).parent
RECORDED, COSTS = DOCS / "scale_runs.csv", DOCS / "scale_costs.csv"

RUNS = (10, 1_000, 100_000)
WORKERS = (2, 64, 1_000)

FILES_PER_SECOND, MEGABYTES_PER_SECOND = 1_000.0, 500.0
"""An assumption: what a shared file system writes, flushes and renames in a second."""


@dataclass(frozen=True)
class Load:
    """What a run asks for: seconds of the client, of a worker, and of the file system before and
    after.
    """

    client: float
    reading: float
    working: float
    writing: float


@dataclass(frozen=True)
class Bounds:
    """What a campaign takes at least, in seconds, because of each of what it shares; and of its
    longest run.
    """

    client: float
    files: float
    workers: float
    longest: float

    @property
    def least(self) -> float:
        """The largest of them."""
        return max(self.client, self.files, self.workers, self.longest)

    @property
    def limit(self) -> str:
        """What that is."""
        named = {
            self.client: "client and scheduler",
            self.files: "file system",
            self.longest: "longest run",
            self.workers: "workers",
        }
        return named[self.least]


def bounds(loads: Sequence[Load], workers: int) -> Bounds:
    """On paper: nothing is done faster than by one resource alone, always busy."""
    alone = [load.client + load.reading + load.working + load.writing for load in loads]
    return Bounds(
        client=sum(load.client for load in loads),
        files=sum(load.reading + load.writing for load in loads),
        workers=sum(load.reading + load.working + load.writing for load in loads) / workers,
        longest=max(alone),
    )


READ, WORK, WRITE = range(3)


def simulated(loads: Sequence[Load], workers: int) -> float:
    """Seconds until the last run is done: the client sends one run after the other, in order, and
    the file system serves one at a time.
    """
    sent = _sums(load.client for load in loads)
    events: list[
        tuple[float, int, int]
    ] = []  # when, what, which run; equal times in the order of the campaign
    free = [0.0] * min(workers, len(loads))
    disk, end, nexts = 0.0, 0.0, iter(range(len(loads)))

    def begin(at: float) -> None:
        run = next(nexts, None)
        if run is not None:
            heapq.heappush(events, (max(at, sent[run]), READ, run))

    for at in free:
        begin(at)
    while events:
        now, what, run = heapq.heappop(events)
        if what == WORK:
            heapq.heappush(events, (now + loads[run].working, WRITE, run))
            continue
        disk = max(now, disk) + (loads[run].reading if what == READ else loads[run].writing)
        if what == READ:
            heapq.heappush(events, (disk, WORK, run))
        else:
            end = max(end, disk)
            begin(disk)
    return end


def _sums(parts: Iterator[float]) -> list[float]:
    total, sums = 0.0, []
    for part in parts:
        total += part
        sums.append(total)
    return sums


def recorded() -> list[Load]:
    """Return the runs that were recorded, in the order of their names."""
    costs = {row["what"]: float(row["seconds"]) for row in _rows(COSTS)}
    client = costs["spec"] + costs["task"]
    return [
        Load(
            client=client,
            reading=float(row["read_MB"]) / MEGABYTES_PER_SECOND,
            working=float(row["seconds"]),
            writing=float(row["files"]) / FILES_PER_SECOND
            + float(row["written_MB"]) / MEGABYTES_PER_SECOND,
        )
        for row in _rows(RECORDED)
    ]


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def limits() -> Table:
    """Return what limits so many runs on so many workers."""
    runs = recorded()
    rows = []
    for count in RUNS:
        loads = list(islice(cycle(runs), count))
        alone = simulated(loads, 1)
        for workers in WORKERS:
            least, took = bounds(loads, workers), simulated(loads, workers)
            rows.append(
                (
                    f"{count} on {workers}",
                    least.client,
                    least.files,
                    least.workers,
                    least.longest,
                    least.limit,
                    took,
                    alone / took,
                )
            )
    columns = (
        "runs on workers",
        "client [s] .1f",
        "file system [s] .1f",
        "workers [s] .1f",
        "longest run [s] .1f",
        "what limits",
        "simulated [s] .1f",
        "times faster than one worker .3g",
    )
    return Table.of(
        "limits",
        "Shortest time that each limit allows for a campaign, and simulated time",
        columns,
        rows,
    )


def record(runs: Path) -> None:
    """Write what the finished runs of a folder took, and what the client and a Dask scheduler take
    for one.
    """
    rows = [row for record in sorted(runs.glob("*/run.json")) if (row := _recorded(record.parent))]
    _write(RECORDED, ["run", "seconds", "files", "read_MB", "written_MB"], rows)
    _write(
        COSTS,
        ["what", "seconds"],
        [("spec", f"{_seconds_of_a_spec():.4f}"), ("task", f"{_seconds_of_a_task():.4f}")],
    )


def _recorded(folder: Path) -> tuple[object, ...] | None:
    stages = json.loads((folder / "run.json").read_text(encoding="utf-8"))["stages"]
    if "report" not in stages:  # a variation: it is part of its run
        return None
    parts = [folder, *folder.parent.glob(f"{folder.name}.*")]
    files = [path for part in parts for path in part.rglob("*") if path.is_file()]
    read = sum(stamp["size"] for stamp in stages["ingest"]["inputs"].values())
    seconds = sum(stage["seconds"] for stage in stages.values())
    return (
        folder.name,
        f"{seconds:.1f}",
        len(files),
        f"{read / 1e6:.2f}",
        f"{sum(path.stat().st_size for path in files) / 1e6:.2f}",
    )


def _write(path: Path, header: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([header, *rows])


def _seconds_of_a_spec(times: int = 20) -> float:
    """Processor time of the client for one spec."""
    spec = CONFIGS / "m2" / "dmsp-20-88-static.yaml"
    load(spec)
    started = time.process_time()
    for _ in range(times):
        load(spec)
    return (time.process_time() - started) / times


def _seconds_of_a_task(tasks: int = 1_000) -> float:
    """Processor time of a client, a scheduler and two workers in one process, for a task that does
    nothing.
    """
    from distributed import Client, LocalCluster

    with (
        LocalCluster(
            n_workers=2, threads_per_worker=1, processes=False, dashboard_address=None
        ) as cluster,
        Client(cluster) as client,
    ):
        client.gather(client.map(abs, range(10), pure=False))
        started = time.process_time()
        client.gather([client.submit(abs, number, pure=False) for number in range(tasks)])
        return (time.process_time() - started) / tasks


if __name__ == "__main__":
    parser = ArgumentParser()
    parser.add_argument(
        "runs", type=Path, nargs="?", help="folder of the muscles that are recorded"
    )
    if (runs := parser.parse_args().runs) is not None:
        record(runs)
    write_tables(DOCS / "scale.md", {"limits": limits})
