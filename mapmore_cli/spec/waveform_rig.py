"""P's rig and its experiments as a simulation's spec names them; volts, kPa, kg, s, and SI units for air: m3, m3/(s Pa)."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from mapmore_cli.spec.fields import Name, Positive, Section
from mapmore_cli.spec.simulated_experiments import NonNegative, RubberSpec

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
    rubber: RubberSpec

    @model_validator(mode="after")
    def _possible(self) -> Waveforms:
        if 10 * self.sample_time > min(1.0 / waveform.frequency for waveform in self.waveforms):
            raise ValueError("each wavelength needs ten samples: shorten `sample_time` or lower `frequency`")
        return self
