"""Models with memory: delayed quantities, slow states, hysteresis operators and resonances as candidates of one regression.

A state is a name (`terms.states`): `force[k-1]`, `slow(play(pressure, 0.16), 0.3)`. `families` writes such names, and the products that
make a dictionary; `resolution` finds the numbers behind them in training; `evaluation` computes them along a piece of a recording;
`fitting` selects terms and fits them; `free_run` simulates.
"""

from mapmore_cli.modelling.memory.fitting import fit_with_memory
from mapmore_cli.modelling.memory.free_run import free_run, one_step_ahead
from mapmore_cli.modelling.memory.recipe import MemoryRecipe
from mapmore_cli.modelling.memory.records import AtSample, Record, numbered, records_of, time_step, uninterrupted

__all__ = [
    "AtSample",
    "MemoryRecipe",
    "Record",
    "fit_with_memory",
    "free_run",
    "numbered",
    "one_step_ahead",
    "records_of",
    "time_step",
    "uninterrupted",
]
