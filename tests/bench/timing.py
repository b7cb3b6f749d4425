"""Seconds, by the median of a few runs."""

from __future__ import annotations

from statistics import median
from time import perf_counter

LONG = 20.0
"""Above this many seconds, one run is enough."""


def seconds(function):
    start = perf_counter()
    function()
    return perf_counter() - start


def median_seconds(function, runs):
    """Median of several runs; of the first alone where that is long."""
    first = seconds(function)
    if first > LONG:
        return first
    return median([first, *(seconds(function) for _ in range(runs - 1))])


def in_turn(functions, runs, of=median):
    """Median seconds of each function by name, run in turns, so that a busy moment of the machine
    hits all of them alike; or the least, which is that of the machine at rest.
    """
    for function in functions.values():
        function()
    rounds = [
        {name: seconds(function) for name, function in functions.items()} for _ in range(runs)
    ]
    return {name: of(one[name] for one in rounds) for name in functions}
