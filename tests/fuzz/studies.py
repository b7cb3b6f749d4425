"""Made studies: a folder whose draft by `init` passes `check`; and a spec of chance: what passes
`check` is run to its end, or refused with a reason in the data.
"""

from __future__ import annotations

import shutil

import numpy as np
from driver import Fault, Target, refused
from readers import text as any_text

from mapmore_cli.annexes.drafting.answers import answers_of
from mapmore_cli.annexes.drafting.start import start
from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.pipeline.inspection import inspect
from mapmore_cli.pipeline.runner import bring_up_to_date
from mapmore_cli.study.loader import load, load_text
from mapmore_cli.study.yaml_dumper import dump

NAMES = (
    *(
        "run {}",
        "log[{}]",
        "a #{}",
        "x,{}",
        "Prüfung {}",
        "{}kPa",
        "[{}",
        "trial_{:02}",
        "p={} bar",
    ),
    *("πίεση {}", "{}#1", "a{{{}}}", "50%_{}", "'{}'", "!{}", "- {}", "{}: b", "sub/{}", "[a-c]{}"),
)
ENDS = (4, 5, 6)
"""Exit codes of what is refused after `check`: the data, numbers that cannot be, the model."""


def swing(chance, rows, first):
    """Time, pressure in kPa and a force that lags behind it."""
    time = 0.01 * np.arange(rows)
    pressure = 200 + 100 * np.sin(chance.uniform(1, 9) * time + chance.uniform(0, 6))
    noise = np.random.default_rng(chance.randrange(1 << 30)).normal(0, 1, (2, rows))
    lagging = np.convolve(pressure, np.full(5, 0.2))[:rows]
    return np.column_stack([time + first, pressure + noise[0], lagging + noise[1]])


def made_folder(chance, place):
    """Write files of one kind under names of chance: some with gaps, in sheets, or bad."""
    title, name = "t [s];P [kPa];F [N]", chance.choice(NAMES)
    rows, cut = chance.choice([30, 90, 300]), chance.random() < 0.3
    sheets = {}
    for number in range(chance.randint(1, 6)):
        table = swing(chance, rows, chance.choice([0, 0, 5]))
        if cut:
            table[rows // 2 :, 0] += chance.choice([3, 60, 4000])
        if chance.random() < 0.1:
            table = table[: chance.choice([0, 1])]
        sheets[name.format(number)] = table
    if chance.random() < 0.15:
        book = __import__("openpyxl").Workbook()
        book.remove(book.active)
        for number, table in enumerate(sheets.values()):
            sheet = book.create_sheet(chance.choice(["Run {} (a)", "r#{}", "x, {}"]).format(number))
            sheet.append(title.split(";"))
            for row in table.tolist():
                sheet.append(row)
        book.save(place / "book.xlsx")
        return
    for label, table in sheets.items():
        path = place / f"{label}.csv"
        path.parent.mkdir(exist_ok=True)
        lines = [";".join(f"{value:.5f}" for value in row) for row in table]
        path.write_text("\n".join([title, *lines]) + "\n", encoding="utf-8")
    if chance.random() < 0.2:
        (place / "empty.csv").write_text("")
    if chance.random() < 0.1:
        (place / "other.csv").write_bytes(any_text(chance))


def draft_folder(chance, number, folder):
    """Every draft of a made folder loads, and `check` finds no error in it."""
    place = folder / f"folder{number}"
    place.mkdir()
    try:
        made_folder(chance, place)
        drafts = start(place, place, answers=answers_of(target="F", inputs="P")).drafts
        for draft in drafts:
            (place / "draft.yaml").write_text(draft.text(), encoding="utf-8")
            report = inspect(load(place / "draft.yaml"))
            if errors := [one.message for one in report.issues if one.severity == "error"]:
                raise Fault(f"a draft that does not pass: {errors}")
        return "drafted"
    except MapmoreError as error:
        if "draft" in str(error.message):
            raise Fault(f"a draft that does not pass: {error.message}") from error
        return refused(error)
    finally:
        shutil.rmtree(place)


def column(chance, rows):
    """Values of an input, of sorts that a search may stumble over."""
    random = np.random.default_rng(chance.randrange(1 << 30))
    return chance.choice(
        [
            lambda: random.random(rows),
            lambda: np.repeat(100.0 * np.arange(1, 5), -(-rows // 4))[:rows],
            lambda: np.linspace(0, chance.choice([1, 1e-6, 1e6]), rows),
            lambda: np.full(rows, 3.0),
            lambda: np.sin(0.3 * np.arange(rows)),
            lambda: np.arange(rows) % 2.0,
        ]
    )()


def made_study(chance, place):
    """Return a spec of chance, with its recordings beside it."""
    names = [f"a{number}" for number in range(chance.choice([1, 1, 2, 3, 8, 10]))]
    files = chance.choice([1, 1, 2, 4])
    rows = chance.choice([2, 4, 6, 9, 12, 20, 40, 80])
    for number in range(files):
        values = [column(chance, rows) for _ in names]
        target = sum(values) + 0.1 * np.random.default_rng(number).random(rows)
        table = np.column_stack([0.01 * np.arange(rows), *values, target])
        header = ",".join(["t", *names, "y"])
        np.savetxt(
            place / f"r{number}.csv", table, fmt="%.8g", delimiter=",", header=header, comments=""
        )
    columns = {name: {"column": name} for name in (*names, "y")}
    if chance.random() < 0.4:
        columns["time"] = {"column": "t", "unit": "s"}
    data = {"files": ["r*.csv"], "columns": columns}
    splits = [
        {},
        {"validate": {"last": chance.choice([0.1, 0.3, 0.9])}},
        {"validate": {"recordings": ["r0"]}},
        {"validate": {"fraction": chance.choice([0.1, 0.5, 0.95]), "seed": 1}},
        {"validate": {"a0": {"between": [[0.2, 0.5]]}}},
        {"leave_one_level_out": True},
    ]
    if split := chance.choice(splits):
        data["split"] = split
    if chance.random() < 0.3:
        data["levels"] = {"of": "a0"}
    if "time" in columns and chance.random() < 0.5:
        data["resample"] = chance.choice([0.01, 0.05])
    models = [
        {"type": "auto", "budget": "1 s"},
        {"type": "auto", "budget": "1 s"},
        {"type": "auto", "budget": "1 s"},
        {},
    ]
    spec = {"schema_version": 1, "name": "made", "data": data, "target": "y"}
    if model := chance.choice(models):
        spec["model"] = model
    else:
        spec["dictionary"] = [{"polynomial": {"of": names[:2], "order": chance.choice([1, 3])}}]
    return spec


def run_study(chance, number, folder):
    """What passes `check` is run, or refused with one of the codes of `ENDS`."""
    place = folder / f"study{number}"
    place.mkdir()
    try:
        loaded = load_text(dump(made_study(chance, place)), "made.yaml", place)
        report = inspect(loaded)
        if any(issue.severity == "error" for issue in report.issues):
            return "check finds errors"
    except MapmoreError as error:
        shutil.rmtree(place)
        return f"check: {refused(error)}"
    try:
        bring_up_to_date(loaded, place / "runs", warn=lambda _message: None)
    except MapmoreError as error:
        if error.exit_code not in ENDS:
            raise Fault(f"check passed, and run: {error.message}") from error
        return refused(error)
    finally:
        shutil.rmtree(place)
    return "done"


FOLDERS = Target("folders", draft_folder, past=("drafted",), longest=30)
RUNS = Target(
    "studies", run_study, past=("done", *(f"refused (exit {one})" for one in ENDS)), longest=120
)
