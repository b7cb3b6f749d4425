"""What has to be told to turn recordings into a model with memory."""

from __future__ import annotations

from dataclasses import dataclass

from mapmore_cli.modelling.selection import Fit


@dataclass(frozen=True, kw_only=True)
class MemoryRecipe(Fit):
    """The choices of a model with memory: those of `Fit`, and what they act on.

    With a ridge candidates are centred and divided by their standard deviations, and the model has a constant of its own; without, a
    constant is a candidate like any other. `tolerance` is a fraction of the output's square (of its variance with a ridge).

    - `target`: the output.
    - `dictionary`: candidate terms as text, products of names of states.
    - `step`: time between samples, s.
    """

    target: str
    dictionary: tuple[str, ...]
    step: float
