"""Specs of terms with memory: what loads, and what is refused with its place."""

from __future__ import annotations

from pathlib import Path

import pytest
from spec_examples import load_text, refusal, refuse_slip

MOTION = """\
name: motion
data:
  files: ["*.csv"]
  columns: {time: {column: t}, pressure: {column: p}, load: {column: w}, displacement: {column: x, unit: mm}}
  resample: 10 ms
  split: {validate: {last: 0.5}}
target: {column: displacement}
dictionary:
  - lags: {of: [displacement, pressure], steps: [1, 2], order: 2}
  - products:
      of: [pressure, "play(pressure, 0.16)", {slow: {of: [pressure], tau: [0.3 s, 1 s]}}, {delays: {of: [displacement], times: [50 ms]}}]
      order: 2
      with: [pressure]
  - terms: ["pressure*displacement[k-1]", "exp(-play(pressure, 0.2)/300)"]
fit: {max_terms: 4, ridge: auto, forward: 12}
"""
RECORD = """\
schema_version: 1
name: coiled-200g
data:
  files: ["${MAPMORE_DATA:-../../shared/data}/coiled_isotonic_steps/Sample 1 Final 200 grams.xlsx"]
  reader: xlsx
  header: false
  columns: {time: {column: 2, unit: s}, pressure: {column: 3, unit: psi}, displacement: {column: 4, unit: mm, scale: -1}}
  gaps: {longer_than: 10 ms, action: split}
  resample: 10 ms
  split: {validate: {last: 0.5}}
target: {column: displacement}
dictionary:
  - products:
      of: [{lags: {of: [pressure], steps: [0, 1]}}, {slow: {of: [pressure], tau: [0.05, 0.5, 5]}}, {play: {of: [pressure], count: 4}}]
      order: 2
fit: {max_terms: 12, stop: bic, ridge: auto}
"""
NO_DELAYS = RECORD.replace("max_terms: 12, stop: bic", "max_terms: 4")
FED_BACK = MOTION.replace(
    "{slow: {of: [pressure]", '{play: {of: ["displacement[k-1]"], count: 2}}, {slow: {of: ["stop(displacement[k-2], 0.1)"]'
)
FED_BACK = FED_BACK.replace("exp(-play(pressure, 0.2)", "exp(-slow(displacement[k-1], 0.2)")
IN_FREE_RUN = MOTION.replace("max_terms: 4", "max_terms: 4, criterion: free_run, stop: free_run, select: free_run")
FORCE = """\
name: force
data: {files: [a.csv], columns: {time: {column: 0}, pressure: {column: 1}, strain: {column: 2}, force: {column: 3}}}
target: static
dictionary: [{polynomial: {of: [pressure, strain], order: 2}}]
"""


PAST_FORCE = FORCE.replace("of: [pressure, strain]", 'of: [pressure, "force[k-1]"]')


@pytest.mark.parametrize("text", [MOTION, RECORD, FED_BACK, IN_FREE_RUN, FORCE, PAST_FORCE])
def test_what_is_right_loads_and_resolves_to_itself(text: str, tmp_path: Path) -> None:
    loaded = load_text(tmp_path, text)
    assert load_text(tmp_path, loaded.resolved).spec == loaded.spec


def test_states_stay_in_physical_units_where_nothing_is_said(tmp_path: Path) -> None:
    assert load_text(tmp_path, MOTION).spec.fit.scaling == "none"


SLIPS = [
    # names
    (MOTION, "lags: {of: [displacement, pressure]", "lags: {of: [displacement, ▸presure]", ["no quantity `presure`", "`pressure`?"]),
    (MOTION, '"play(pressure, 0.16)"', '"play(▸presure, 0.16)"', ["no quantity `presure`", "did you mean `pressure`?"]),
    (MOTION, "slow: {of: [pressure]", 'slow: {of: ["stop(▸lod, 0.1)"]', ["no quantity `lod`", "did you mean `load`?"]),
    (MOTION, "with: [pressure]", "with: [▸pressur]", ["no quantity `pressur`", "did you mean `pressure`?"]),
    (MOTION, '"pressure*displacement[k-1]"', '"load*▸presure[k-1]"', ["no quantity `presure`", "did you mean `pressure`?"]),
    (MOTION, "exp(-play(pressure, 0.2)", "exp(-play(slow(▸presure, 1), 0.2)", ["no quantity `presure`"]),
    (MOTION, '"play(pressure, 0.16)"', '▸"plai(pressure, 0.16)"', ["not the name of a quantity or a state", "no operator"]),
    (MOTION, '"play(pressure, 0.16)"', '"play(pressure, 0.1, 0.2▸)"', ["`play` takes 0 or 1 number(s)"]),
    (MOTION, '"play(pressure, 0.16)"', '"pressure▸[k+1]"', ["a delay is written [k-1]"]),
    (MOTION, "exp(-play(pressure, 0.2)/300)", "exp(-play(pressure, 0.1, 0.2▸)/300)", ["not an expression", "takes 0 or 1 number(s)"]),
    (FORCE, "of: [pressure, strain]", 'of: [pressure, "strain▸^2"]', ["not the name of a quantity or a state"]),
    (FORCE, "{polynomial: {of: [pressure, strain]", "{products: {with: [▸time], of: [pressure, strain]", ["`time` is none of the terms"]),
    # the target, by its past alone
    (MOTION, "steps: [1, 2]", "steps: [1, ▸0]", ["step 0 of the target `displacement`", "begin at 1"]),
    (MOTION, "of: [pressure, ", "of: [▸displacement, ", ["`displacement` is the target", "`displacement[k-1]`"]),
    (MOTION, "slow: {of: [pressure]", "slow: {of: [▸displacement]", ["`slow` works on `displacement` as it is now", "`displacement[k-1]`"]),
    (MOTION, '"play(pressure, 0.16)"', '"play(▸displacement, 0.16)"', ["`play` works on `displacement`"]),
    (MOTION, '"play(pressure, 0.16)"', '"play(▸displacement, 0.16)[k-1]"', ["`play` works on `displacement` as it is now"]),
    (MOTION, "lags: {of: [displacement,", 'lags: {of: ["stop(▸displacement, 0.1)",', ["`stop` works on `displacement` as it is now"]),
    (MOTION, '"pressure*displacement[k-1]"', "pressure*▸displacement", ["`displacement` is the target", "take it out"]),
    (MOTION, '"pressure*displacement[k-1]"', '▸"exp(pressure*displacement[k-1])"', ["in one factor", "as a product"]),
    (MOTION, "delays: {of: [displacement]", 'delays: {of: [▸"displacement[k-1]"]', ["no quantity", "name `displacement` itself"]),
    # what memory needs
    (MOTION, "name: motion", "name: motion\nunits: {▸time: ms}", ["goes by the time in s", "remove it"]),
    (MOTION, "last: 0.5", "▸fraction: 0.5", ["drawn at random", "`last: 0.25`"]),
    (MOTION, "  resample", "  ▸cycles: {over: pressure, samples: 100}\n  resample", ["`cycles` puts samples in the order of `pressure`"]),
    (MOTION, "fit:", "segment: {▸pressure: {method: even, count: 2}}\nfit:", ["`pressure` cannot be cut", "`pressure: none`"]),
    (MOTION, "  resample", "  ▸levels: {of: load, at: [1, 2]}\n  resample", ["not interpolated between levels", "segment: {load: none}"]),
    (MOTION, "fit:", "fuse: {▸z_s: 0.1}\nfit:", ["there is nothing to join", "remove `z_s`"]),
    (MOTION, "ridge: auto", "ridge: auto, scaling: ▸max_abs", ["`max_abs` scales segments", "`none`, or `range`"]),
    (MOTION, "ridge: auto", "ridge: auto, ▸margin: 0.2", ["`margin` clips", "add `scaling: range`"]),
    (MOTION, "ridge: auto, ", "▸", ["pruned only where there is a ridge", "add `ridge: auto`"]),
    (MOTION, "forward: 12", "forward: ▸3", ["3 terms cannot be pruned to `max_terms: 4`", "4 or more"]),
    # free run
    (NO_DELAYS, "max_terms: 4", "max_terms: 4, ▸criterion: free_run", ["nothing of the output displacement is fed back", "add delays"]),
    (MOTION, "max_terms: 4", "max_terms: 4, ▸select: free_run, criterion: free_run", ["need `stop: free_run`", "remove `select`"]),
    # what is of memory alone
    (FORCE, "order: 2}}]", "order: 2}}]\nfit: {▸ridge: 0.1}", ["`ridge` belongs to terms with memory", "remove it"]),
    (FORCE, "order: 2}}]", "order: 2}}]\nfit: {▸forward: 9}", ["`forward` belongs to terms with memory"]),
    (FORCE, "order: 2}}]", "order: 2}}]\nfit: {stop: ▸free_run}", ["`stop: free_run` belongs to terms with memory"]),
    (FORCE, "order: 2}}]", "order: 2}}]\nfit: {scaling: ▸range}", ["`scaling: range` belongs to terms with memory"]),
    (FORCE, "column: 3}}", 'column: 3}}, derive: {a: "1 + play(▸pressure, 0.1)"}', ["has memory, which derived quantities have not"]),
]  # fmt: skip


@pytest.mark.parametrize(("base", "old", "new", "words"), SLIPS, ids=lambda value: str(value)[:40])
def test_one_slip_gives_one_message_with_its_place(tmp_path: Path, base: str, old: str, new: str, words: list[str]) -> None:
    refuse_slip(tmp_path, base, old, new, words)


def test_memory_needs_the_time(tmp_path: Path) -> None:
    text = FORCE.replace("time: {column: 0}, ", "").replace("{polynomial", "{play: {of: [pressure], count: 2}}, {polynomial")
    message = refusal(tmp_path, text)
    assert message.startswith("spec.yaml:4:14: a model with memory needs the time")
    assert "`sample_time`" in message


@pytest.mark.parametrize("family", ["lags: {of: [force], steps: [1]}", 'terms: ["force[k-1]"]', "slow: {of: [force], tau: [1 s]}"])
def test_nothing_of_a_derived_target_can_be_fed_back(family: str, tmp_path: Path) -> None:
    text = FORCE.replace("target: static", "target: damping\nneeds: {static: s.yaml}").replace(
        "force: {column: 3}}", "force: {column: 3}}, plateau: auto"
    )
    message = refusal(tmp_path, text.replace("{polynomial", f"{{{family}}}, {{polynomial"))
    assert "`force` is the target" in message
    assert "look back" not in message


def test_a_family_of_wrong_form_hides_no_other_mistake_and_adds_none(tmp_path: Path) -> None:
    text = FORCE.replace("[{polynomial", "[{play: {of: [pressure], widths: [0.1], count: 2}}, {polynomial")
    text = text.replace("order: 2}}]", "order: 2}}]\nfit: {ridge: auto}")
    message = refusal(tmp_path, text.replace("strain], order", "strian], order"))
    assert "`play` takes either `widths` or `count`" in message
    assert "no quantity `strian`" in message
    assert message.count("spec.yaml:") == 2, message
