"""Tables for models with memory: any cut into recordings, gaps and empty cells gives what each piece gives by itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cli_samples import hand_model
from hypothesis import given
from hypothesis import strategies as st

from mapmore_cli.domain.memory import MemoryModel, StateSet
from mapmore_cli.domain.models import CurveRange, Memory, Model, Part, Sum
from mapmore_cli.domain.recording import Quantity, Signal
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.study.prediction.predict import predicted_lines

STEP = 0.01
STATES = StateSet(("force[k-2]", "slow(pressure, 0.05)", "pressure[k-1]"), STEP, {}, {}, np.empty(0), np.empty(0), 0.15)
MEMORY = MemoryModel(
    "force", STATES, ("force[k-2]", "slow(pressure, 0.05)", "pressure[k-1]"), np.array([0.5, 2.0, -1.0]), np.zeros(3), 3.0, (-1e4, 1e4)
)
LIMITS = {"pressure": (100.0, 200.0)}
REMEMBERING = Model(
    name="remembering",
    output=Quantity("force", "N"),
    inputs=(Quantity("pressure", "kPa"),),
    body=Memory(MEMORY, (CurveRange("all", None, LIMITS),)),
)
STATIC = hand_model()
SUM = replace(REMEMBERING, name="sum", inputs=STATIC.inputs, body=Sum((Part(STATIC), Part(REMEMBERING))))

pieces = st.lists(st.tuples(st.integers(3, 12), st.sampled_from(["gap", "reset", "recording", "empty"])), min_size=1, max_size=6)


@given(pieces, st.integers(0, 100), st.sampled_from([REMEMBERING, SUM]))
def test_every_piece_is_predicted_as_by_itself(cuts: list[tuple[int, str]], seed: int, model: Model) -> None:
    rng = np.random.default_rng(seed)
    names = ("time", "pressure", "strain", "force")
    lines, wanted, time, recording = ["recording,time,pressure,strain,force\n"], [], 0.0, 0
    for size, end in cuts:
        stamps = time + STEP * np.arange(size)
        last = float(stamps[-1])
        columns = dict(zip(names, (stamps, *rng.uniform(100, 200, (1, size)), *rng.uniform(0, 0.1, (2, size))), strict=True))
        wanted += predict(model, columns).tolist()
        lines += [f"{recording}," + ",".join(map(repr, row)) + "\n" for row in zip(*(x.tolist() for x in columns.values()), strict=True)]
        time = {"gap": last + 7 * STEP, "reset": 0.0, "recording": last + STEP, "empty": last + 2 * STEP}[end]
        if end == "empty":
            lines.append(f"{recording},{last + STEP!r},,0.05,1.0\n")
            wanted.append(np.nan)
        recording += end == "recording"
    found = [line.rstrip("\n").split(",")[-2] for line in predicted_lines(model, lines, "t")][1:]
    np.testing.assert_allclose([float(cell or "nan") for cell in found], wanted, rtol=1e-11)


@pytest.mark.parametrize("model", [REMEMBERING, SUM], ids=["alone", "in a sum"])
def test_the_past_is_asked_for_where_a_model_feeds_back(model: Model) -> None:
    inputs = [quantity.name for quantity in model.inputs]
    with pytest.raises(Exception, match="no column 'force'"):
        list(predicted_lines(model, [",".join(["time", *inputs]) + "\n"], "t"))
    with pytest.raises(Exception, match="t: the table is empty") as caught:
        list(predicted_lines(model, [], "t"))
    assert "time [s], pressure [kPa]" in str(caught.value)
    assert "force [N]" in str(caught.value)


def test_rates_are_derived_before_memory_runs() -> None:
    states = StateSet(("slow(pressure_rate, 0.05)",), STEP, {}, {}, np.empty(0), np.empty(0), 0.15)
    memory = MemoryModel("force", states, states.names, np.array([2.0]), np.zeros(1), 0.0, (-1e9, 1e9))
    model = replace(
        REMEMBERING,
        inputs=(Quantity("pressure_rate", "kPa/s"),),
        body=Memory(memory, (CurveRange("all", None, {"pressure_rate": (0.0, 10.0)}),)),
        signals=(Signal("pressure_rate", "rate", "pressure", window=0.05, order=1),),
    )
    rows = [f"{k * STEP!r},{100 + 3 * k * STEP!r}\n" for k in range(50)]
    found = [line.split(",")[-2] for line in predicted_lines(model, ["time,pressure\n", *rows], "t")][1:]
    np.testing.assert_allclose([float(cell) for cell in found], 6.0)  # 3 kPa/s all along
