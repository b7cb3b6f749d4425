"""The experiments that a simulation can run: slow load cycles, step responses, perturbations at constant pressure, P's waveforms."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from mapmore_cli.domain.declared import NonNegative, Positive
from mapmore_cli.rig.air import Reservoir
from mapmore_cli.rig.load_cycle import Regulation
from mapmore_cli.rig.muscle import Rubber
from mapmore_cli.rig.step_response import Bumper
from mapmore_cli.rig.water import Pipe, Wall
from mapmore_cli.spec.fields import Name, Section

Command = Annotated[float, Field(ge=0, le=10)]  # V


class RegulatorSpec(Section):
    """Proportional pressure regulator behind an ISO 6358 valve (see `mapmore_cli.rig.waveform`)."""

    slope: Positive  # of the wanted pressure, kPa/V
    offset: float  # at no input, kPa
    lag: Positive  # of the wanted pressure, s
    band: Positive  # missing pressure at which its valve is fully open, kPa
    supply: Positive  # kPa, gauge
    supply_conductance: Positive  # m3/(s Pa)
    exhaust_conductance: Positive
    critical_ratio: Annotated[float, Field(ge=0, lt=0.99)]


class WaveformSpec(Section):
    """One recording: rest, then so many wavelengths, which begin at `low` (a square wave at `high`)."""

    name: Name
    shape: Literal["sine", "triangle", "square"]
    low: Command
    high: Command
    frequency: Positive  # Hz
    wavelengths: Annotated[int, Field(ge=1)]
    rest_at: Command = 0.0  # input before the first wavelength, under which the muscle has come to rest
    load: NonNegative = 0.0  # that hangs on the muscle beside its own end, kg

    @model_validator(mode="after")
    def _upright(self) -> WaveformSpec:
        if self.low >= self.high:
            raise ValueError("`low` must lie below `high`")
        return self


def _named_once(waveforms: list[WaveformSpec]) -> list[WaveformSpec]:
    if len({waveform.name for waveform in waveforms}) != len(waveforms):
        raise ValueError("each waveform makes one recording: give it a name of its own")
    return waveforms


class Waveforms(Section):
    """The input of a regulator follows waveforms, one recording each; a hanging McKibben muscle moves (P section 2.4, table 2)."""

    type: Literal["waveforms"]
    waveforms: Annotated[list[WaveformSpec], Field(min_length=1), AfterValidator(_named_once)]
    rest: Positive  # before the first wavelength, s
    sample_time: Positive  # s
    regulator: RegulatorSpec
    polytropic: Annotated[float, Field(ge=1, le=1.4)]  # of the air in the muscle
    dead_volume: NonNegative  # of hose and fittings, m3
    end_mass: Positive  # of the muscle's lower end and the encoder's slide, kg
    rubber: Rubber

    @model_validator(mode="after")
    def _possible(self) -> Waveforms:
        if 10 * self.sample_time > min(1.0 / waveform.frequency for waveform in self.waveforms):
            raise ValueError("each wavelength needs ten samples: shorten `sample_time` or lower `frequency`")
        return self


class WaterRig(Section):
    """From the reservoir to the load cell (see `mapmore_cli.rig.water`)."""

    line: Pipe  # reservoir to pressure sensor
    hose: Wall  # of the line, where the sensor sits
    tube: Pipe  # sensor to muscle
    trapped_air: Positive  # in the muscle, m3 at no gauge pressure
    wall: Wall  # of the muscle
    rubber: Rubber
    load_cell: Positive  # cut-off of its amplifier, Hz


Pressure = Annotated[float, Field(ge=0, le=2000)]  # kPa, gauge; above, the geometry of the muscles means nothing
Fraction = Annotated[float, Field(ge=0, le=1)]
DrivingPressure = Annotated[float, Field(gt=0, le=1000)]  # kPa, gauge; that fills a muscle with water


def pressure_label(pressure: float) -> str:
    """Name of a pressure in file names: `080`, `350`, `82.5`."""
    return f"{pressure:03g}"


def once(pressures: list[float]) -> list[float]:
    """Return the pressures, refused where two of them would give files of one name."""
    if len({pressure_label(pressure) for pressure in pressures}) != len(pressures):
        raise ValueError("each pressure makes one recording: name it once")
    return pressures


class LoadCycles(Section):
    """One slow contraction and extension at each pressure (M1 section IV.A); with more `turns`, reversals inside of that loop."""

    type: Literal["load_cycles"]
    pressures: Annotated[list[Pressure], Field(min_length=1), AfterValidator(once)]  # kPa
    duration: Positive  # of each recording, s
    sample_time: Positive  # s
    dwell: NonNegative  # rest before, between and after the moves, s
    turns: Annotated[list[Fraction], Field(min_length=1)] = [1.0]  # noqa: RUF012 (pydantic copies it); of the stroke, from zero to zero
    least_stroke: Annotated[float, Field(gt=0, le=0.2)]  # strain reached even where the muscle has no force
    regulation: Regulation

    @model_validator(mode="after")
    def _possible(self) -> LoadCycles:
        rests = len(self.turns) + 2
        if rests * self.dwell >= self.duration:
            raise ValueError(f"{rests} rests of `dwell` leave no time to move: lengthen `duration`")
        if any(after == before for before, after in pairwise([0.0, *self.turns, 0.0])):
            raise ValueError("the actuator must move from each of `turns` to the next, beginning and ending at zero")
        if 100 * self.sample_time > self.duration:
            raise ValueError("fewer than 100 samples: shorten `sample_time` or lengthen `duration`")
        return self


class StepSpec(Section):
    """One recording."""

    pressure: DrivingPressure  # of the supply, kPa
    weight: Positive  # that hangs on the muscle, N


def _each_once(steps: list[StepSpec]) -> list[StepSpec]:
    once([step.pressure for step in steps])
    return steps


class StepResponses(Section):
    """A weight is suddenly lifted and dropped again, once for each step (M2 section 4.1, table 3)."""

    type: Literal["step_responses"]
    steps: Annotated[list[StepSpec], Field(min_length=1), AfterValidator(_each_once)]
    rest: Positive  # before the supply opens, s
    hold: Positive  # until the exhaust opens, s
    fall: Positive  # until the recording ends, s
    sample_time: Positive  # s
    reservoir: Reservoir
    bumper: Bumper
    rig: WaterRig

    @property
    def pressures(self) -> list[float]:
        """One for each recording, kPa."""
        return [step.pressure for step in self.steps]

    @model_validator(mode="after")
    def _possible(self) -> StepResponses:
        if any(step.weight <= self.bumper.pretension for step in self.steps):
            raise ValueError("each weight must exceed the `pretension`, or it would hang free of its stop from the start")
        if 10 * self.sample_time > min(self.rest, self.hold, self.fall):
            raise ValueError("`rest`, `hold` and `fall` need ten samples each: shorten `sample_time` or lengthen them")
        return self


class Perturbations(Section):
    """The muscle is stretched and released at constant pressure, at several speeds (M2 section 6.2)."""

    type: Literal["perturbation"]
    pressures: Annotated[list[DrivingPressure], Field(min_length=1), AfterValidator(once)]  # kPa
    between: Annotated[tuple[float, float], Field(strict=False)]  # stretched and contracted end, as fractions of the free strain
    moves: Annotated[list[Positive], Field(min_length=1)]  # duration of each stretch, and of the release after it, s
    dwell: Positive  # before, between and after the moves, s
    sample_time: Positive  # s
    rig: WaterRig

    @model_validator(mode="after")
    def _possible(self) -> Perturbations:
        stretched, contracted = self.between
        if not 0.0 <= stretched < contracted <= 1.0:
            raise ValueError("`between` needs two fractions of the free strain, the stretched end first: [0.2, 0.8]")
        if 10 * self.sample_time > min(self.dwell, *self.moves):
            raise ValueError("each move and `dwell` need ten samples: shorten `sample_time` or lengthen them")
        return self
