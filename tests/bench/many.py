"""Many files in one study, many small runs in one campaign, and the figures of a page; seconds are
of processor time.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
from ingest import peers_reading, usage_of
from program import STUDY

from mapmore_cli.storage.run_record import RUN_RECORD
from mapmore_cli.storage.seals import SEAL, read_seal, states_of, write_seal

ROWS = 60
LEVELS = (100, 200, 300, 400, 500)
SPEC = """
schema_version: 1
name: many-files
data: {files: [many/*.csv], reader: csv, columns: {pressure: {column: P, unit: kPa},
    strain: {column: eps}, force: {column: F, unit: N}}, levels: {of: pressure, at: [LEVELS]},
    split: {validate: {pressure: [300]}}}
target: {column: force}
dictionary: [{polynomial: {of: [strain], order: 2}}]
"""


def mapmore(*arguments):
    return usage_of([sys.executable, "-m", "mapmore_cli", *map(str, arguments), "-q"])[0]


def many_files(folder, count):
    """A study of so many files of 60 rows, beside one of a tenth of them, and beside what only
    reads them.
    """
    took = {}
    for files in (count // 10, count):
        place = Path(folder) / f"many-{files}"
        write_files(place / "many", files)
        spec = place / "many.yaml"
        levels = ", ".join(map(str, LEVELS))
        spec.write_text(SPEC.replace("LEVELS", levels), encoding="utf-8")
        took[files] = mapmore("run", spec, "--runs", place)
    some, every = took.values()
    peers = peers_reading(place / "many")
    return {"files": count, "run": every, "a_tenth_of_them": some, **peers}


def write_files(folder, count):
    """A stroke and back at one of five pressures in each file, with noise of its own."""
    folder.mkdir(parents=True)
    rng = np.random.default_rng(3)
    strain = 0.12 * (1 - np.cos(np.linspace(0, 2 * np.pi, ROWS)))
    for number in range(count):
        pressure = LEVELS[number % len(LEVELS)]
        force = pressure * (1 - 4 * strain) + 50 * strain + rng.normal(0, 1, ROWS)
        rows = zip(strain.tolist(), force.tolist(), strict=True)
        text = "".join(f"{pressure},{e:.6f},{f:.4f}\n" for e, f in rows)
        (folder / f"r{number:05d}.csv").write_text(f"P,eps,F\n{text}", encoding="utf-8")


def many_levels(folder, counts=(200, 500, 1000, 2000)):
    """A study of so many levels of 20 samples each, with its page, and once more without figures on
    it.
    """
    took = {}
    for count in counts:
        place = Path(folder) / f"levels-{count}"
        (place / "many").mkdir(parents=True)
        rng, strain = np.random.default_rng(5), np.linspace(0, 0.2, 20)
        levels = range(100, 100 + count)
        rows = (
            f"{p},{e:.6f},{p * (1 - 4 * e) + 50 * e + noise:.4f}\n"
            for p in levels
            for e, noise in zip(strain.tolist(), rng.normal(0, 0.5, 20).tolist(), strict=True)
        )
        (place / "many" / "levels.csv").write_text("P,eps,F\n" + "".join(rows), encoding="utf-8")
        spec = place / "levels.yaml"
        text = SPEC.replace("LEVELS", ", ".join(map(str, levels)))
        spec.write_text(text.replace("[300]", "[110, 120]"), encoding="utf-8")
        took[str(count)] = mapmore("run", spec, "--runs", place)
        plain = ("--set", "report.figures=[]", "--runs", place / "plain")
        took[f"{count} without figures"] = mapmore("run", spec, *plain)
    return took


def long_log(folder, rows=10_000_000):
    """A study of one log of so many rows at five levels, with its page: seconds, and bytes of
    memory at most.
    """
    place = Path(folder) / "long"
    (place / "many").mkdir(parents=True)
    rng = np.random.default_rng(8)
    strain = 0.12 * (1 - np.cos(np.linspace(0, 2 * np.pi, 20_000)))
    with (place / "many" / "log.csv").open("w", encoding="utf-8") as log:
        log.write("P,eps,F\n")
        for pressure in LEVELS:
            force = pressure * (1 - 4 * strain) + 50 * strain + rng.normal(0, 1, len(strain))
            lines = zip(strain.tolist(), force.tolist(), strict=True)
            text = "".join(f"{pressure},{e:.6f},{f:.4f}\n" for e, f in lines)
            for _ in range(rows // (len(LEVELS) * len(strain))):
                log.write(text)
    spec = place / "long.yaml"
    levels = ", ".join(map(str, LEVELS))
    spec.write_text(SPEC.replace("LEVELS", levels), encoding="utf-8")
    seconds, memory = run_with_memory(spec, place)
    return {"rows": rows, "run": seconds, "memory": memory}


def sixty_inputs(folder, rows=4000):
    """A study of products of two of sixty inputs, with its page: seconds, and bytes of memory at
    most.
    """
    place = Path(folder) / "sixty"
    place.mkdir()
    names = [f"x{number}" for number in range(60)]
    table = np.random.default_rng(9).normal(size=(rows, len(names)))
    y = 3 * table[:, 0] + 2 * table[:, 1] * table[:, 2]
    lines = [",".join(f"{x:.6f}" for x in row) for row in np.column_stack([table, y])]
    (place / "table.csv").write_text("\n".join([",".join([*names, "y"]), *lines, ""]))
    columns = ", ".join(f"{name}: {{column: {name}}}" for name in [*names, "y"])
    spec = place / "sixty.yaml"
    spec.write_text(
        f"schema_version: 1\nname: sixty\ndata: {{files: [table.csv], columns: {{{columns}}}, "
        "split: {validate: {fraction: 0.2, seed: 1}}}\ntarget: {column: y}\n"
        f"dictionary: [{{polynomial: {{of: [{', '.join(names)}], order: 2}}}}]\n"
        "fit: {max_terms: 5, scaling: none}\n"
    )
    seconds, memory = run_with_memory(spec, place)
    return {"rows": rows, "run": seconds, "memory": memory}


def run_with_memory(spec, place):
    command = [sys.executable, "-m", "mapmore_cli", "run", str(spec), "--runs", str(place), "-q"]
    return usage_of(command)


def resumed(folder, count=20_000, made=20):
    """A campaign of so many small runs, of which nothing is to be done: some are `made`, the others
    are copies of these under names of their own.
    """
    place = Path(folder) / "resumed"
    write_files(place / "many", 5)
    text = SPEC.replace("LEVELS", ", ".join(map(str, LEVELS)))
    (place / "many.yaml").write_text(text, encoding="utf-8")
    campaign, runs = place / "campaign.yaml", place / "runs"
    command = ("batch", campaign, "--runs", runs, "--jobs", 1, "--no-pages")
    head = ["schema_version: 1", "campaign: batch", "title: runs", "runs:"]
    lines = [
        f"  - {{base: many.yaml, name: r{i}, set: {{fuse.z_s: {(i % made + 1) / (3 * made)}}}}}"
        for i in range(count)
    ]
    campaign.write_text("\n".join([*head, *lines[:made], ""]), encoding="utf-8")
    first = mapmore(*command)
    for i in range(made, count):
        copy_run(runs / f"r{i % made}", runs / f"r{i}")
    campaign.write_text("\n".join([*head, *lines, ""]), encoding="utf-8")
    return {"runs": count, "each": first / made, "again": mapmore(*command)}


def copy_run(run_dir, copy):
    """Copy a run that is up to date under another name: its results are links, its record and its
    seal are its own.
    """
    copy.mkdir()
    for path in run_dir.iterdir():
        if path.name not in (RUN_RECORD, SEAL):
            (copy / path.name).hardlink_to(path)
    record = (run_dir / RUN_RECORD).read_text(encoding="utf-8")
    record = record.replace(f'"{run_dir.name}', f'"{copy.name}')
    (copy / RUN_RECORD).write_text(record.replace(f'"{run_dir.name}\\', f'"{copy.name}\\'))
    sealed = read_seal(run_dir)
    settings = sealed["question"][4]
    settings[:] = [one.replace(run_dir.name, copy.name) for one in settings]
    sealed["files"] |= states_of(copy, [RUN_RECORD])
    write_seal(copy, sealed)


def many_runs(folder, count):
    """A campaign of about so many small runs without their pages, in one process."""
    widths = -(-count // 8)
    campaign = Path(folder) / "many-runs.yaml"
    configs = os.path.relpath(STUDY.parent, folder)
    campaign.write_text(campaign_of(configs, widths), encoding="utf-8")
    runs = Path(folder) / "many-runs"
    seconds = mapmore("batch", campaign, "--runs", runs, "--jobs", 1, "--no-pages")
    alone = mapmore("run", STUDY, "--runs", Path(folder) / "alone")
    return {"runs": 8 * widths, "each": seconds / (8 * widths), "one_by_itself_with_page": alone}


def campaign_of(configs, widths=3):
    """Two muscles with one to four terms and so many widths of the transition."""
    runs = [
        f"  - {{base: {configs}/{study}.yaml, name: {study}-{terms}-{width}, set: "
        f"{{fit.max_terms: {terms}, fuse.z_s: {width / (3 * widths)}}}}}"
        for study in ("dmsp-20-88-static", "peano-static")
        for terms in (1, 2, 3, 4)
        for width in range(1, widths + 1)
    ]
    return "\n".join(["schema_version: 1", "campaign: batch", "title: runs", "runs:", *runs, ""])


def figures(folder):
    """The page of M2's static study with all of its figures, and without any."""
    runs = Path(folder) / "figures"
    mapmore("validate", STUDY, "--runs", runs)
    page = {
        names: mapmore("report", STUDY, "--runs", runs, "--figures", names)
        for names in ("none", "all")
    }
    return {"figures": page["all"] - page["none"], "without": page["none"]}
