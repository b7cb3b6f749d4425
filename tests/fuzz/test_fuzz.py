"""A few inputs of every kind; `make fuzz` tries as many as one likes."""

import os
import re
import signal

import documents
import drafts
import driver
import edits
import exports
import expressions
import forged
import numpy as np
import pytest
import readers
import small
import specs
import structures
import studies
import tables
import words
from driver import LONGEST, Fault, Target, explore
from pages import DOCS, read_rows

from mapmore_cli.modelling import expressions as terms

pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.mark.parametrize(
    ("target", "count"),
    [
        (expressions.TARGET, 400),
        (specs.TARGET, 60),
        (readers.TARGET, 60),
        *((target, 30) for target in readers.BINARY),
        (small.TARGET, 25),
        (structures.DAMAGED, 50),
        (tables.TARGET, 300),
        (drafts.TARGET, 6),
        (exports.FREE_TEXTS, 25),
        (exports.EXPORTS, 8),
        (words.TARGET, 26),
        (studies.FOLDERS, 4),
        (studies.RUNS, 2),
        (edits.TARGET, 1),
    ],
    ids=lambda x: getattr(x, "name", x),
)
def test_what_strangers_may_write_is_read_or_refused(target, count, tmp_path):
    found = explore(target, count, 16, tmp_path)
    assert found.faults == []
    assert found.outcomes.total() == count


@pytest.mark.parametrize(
    ("target", "count"),
    [(structures.TARGET, 12), (documents.TARGET, 12)],
    ids=["artefacts", "documents"],
)
def test_results_that_somebody_changed_are_refused_or_say_the_same(
    target, count, tmp_path, monkeypatch
):
    monkeypatch.setattr(structures, "RANDOM_RECORDS", 2)
    found = explore(target, count, 16, tmp_path)
    assert found.faults == []
    assert found.outcomes.total() == count
    assert sum(found.outcomes[outcome] for outcome in target.past) >= count / 2


@pytest.mark.parametrize("count", [36, pytest.param(200, marks=pytest.mark.long)])
def test_forged_models_are_refused_or_used(count, tmp_path):
    found = explore(forged.TARGET, count, 16, tmp_path)
    assert found.faults == []
    assert found.outcomes["used"] > count / 10
    assert found.outcomes["refused (exit 4)"] > count / 3


def test_at_least_half_of_specs_and_expressions_are_past_the_syntax(tmp_path):
    for target in (expressions.TARGET, specs.TARGET):
        found = explore(target, 30, 1, tmp_path)
        assert sum(found.outcomes[outcome] for outcome in target.past) >= 15


def test_what_the_driver_must_notice(tmp_path):
    """A fault, a refusal to end, memory without end, and a crash; the inputs behind them are
    tried.
    """

    def attempt(_chance, number, _folder):
        match number:
            case 1:
                raise Fault("this one")
            case 2:
                while True:
                    pass
            case 3:
                return str(len(bytearray(1 << 31)))
            case 4:
                os.kill(os.getpid(), signal.SIGKILL)
        return "fine"

    found = explore(
        Target("driver", attempt, longest=1),
        6,
        16,
        tmp_path,
    )
    assert found.outcomes == {"fine": 2, "FAULT": 4}
    assert [fault.split(": ", 1)[1].split(" (")[0] for fault in found.faults] == [
        "Fault: this one",
        "longer than 1 s",
        "MemoryError:",
        "ended by signal 9",
    ]
    assert LONGEST <= 5


def test_ctrl_c_keeps_what_was_found(tmp_path, monkeypatch):
    def tell(words):
        if " 2 of 9 " in words:
            raise KeyboardInterrupt

    monkeypatch.setattr(driver, "SILENCE", -1)
    found = explore(
        Target("driver", lambda *_: "fine"),
        9,
        16,
        tmp_path,
        tell=tell,
    )
    assert found.interrupted
    assert found.outcomes == {"fine": 2}


def test_what_is_too_long_when_it_is_written_out_is_refused():
    """Accepted, its model would have a term that cannot be read again."""
    with pytest.raises(
        terms.ExpressionError, match=r"11997 characters when its powers are written out"
    ):
        terms.parse("+".join(["x1", "x2"] * 1200))


PAGE = DOCS / "reliability.md"


def test_the_sentences_follow_from_the_tables():
    damaged = np.array([[int(cell) for cell in row[1:]] for row in read_rows(PAGE, "damaged")[1:]])
    tried, refused, same, missed, crashed, hung = damaged.sum(axis=0)
    assert (tried, missed) == (refused + same + crashed + hung, 0)
    rows = read_rows(PAGE, "disturbed")[1:]
    counts = [[int(cell.split(",")[0] or 0) for cell in row[1:-1]] for row in rows]
    assert all(all_of_them == sum(ended) for all_of_them, *ended in counts)
    counts = [int(row[2]) for row in read_rows(PAGE, "strangers")[1:]]
    assert (sum(count >= 100_000 for count in counts), min(counts) >= 10_000) == (5, True)


def test_what_the_page_says_was_tried_adds_up():
    """Every command is one that `run.py` takes, and the inputs of all of them are as many as were
    tried.
    """
    modules = (expressions, readers, documents, specs, structures, drafts)
    names = {
        specs.RUNS.name,
        exports.EXPORTS.name,
        exports.FREE_TEXTS.name,
        *(module.TARGET.name for module in modules),
    }
    rows = read_rows(PAGE, "strangers")[1:]
    assert len(rows) == len(names)
    for _, commands, tried, *_ in rows:
        asked = re.findall(r"run\.py (\d+) \d+ (\w+)", commands)
        assert {name for _, name in asked} <= names
        others = re.findall(r"(\d+) of (?:seed \d+|other seeds)", commands)
        assert sum(map(int, [*(count for count, _ in asked), *others])) == int(tried)


def test_what_the_page_says_was_made_adds_up():
    """Every input has passed, was refused, or is a fault; the command makes as many, or more where
    it was interrupted.
    """
    heading, *rows = read_rows(PAGE, "made")
    assert heading == ["what", "command", "made", "passed", "refused", "faults"]
    targets = {target.name for target in (studies.FOLDERS, studies.RUNS, words.TARGET)}
    asked = [re.fullmatch(r"run\.py (\d+) \d+ (\w+)(, interrupted)?", row[1]) for row in rows]
    assert {one[2] for one in asked} == targets
    assert f"We compiled or ran every {words.COMPILED}th export" in PAGE.read_text()
    for one, row in zip(asked, rows, strict=True):
        made, *outcomes = map(int, row[2:])
        assert made == sum(outcomes)
        assert made == int(one[1]) or (one[3] and made < int(one[1]))


def test_the_trials_of_disturbed_commands_add_up():
    rows = read_rows(PAGE, "disturbed")[1:]
    for command, trials, *ways, _ in rows:
        counts = [int(re.split(r"\D", way)[0]) for way in ways]
        assert sum(counts) == int(trials) == int(re.findall(r"torture\.py (\d+)", command)[0])
    assert sum(int(row[1]) for row in rows) >= 1000
