"""Which samples validate."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path, PurePosixPath

import numpy as np

from mapmore_cli.domain.arrays import BoolArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Recording
from mapmore_cli.ingestion.curves import LevelSet, Part
from mapmore_cli.ingestion.files import relative_name
from mapmore_cli.ingestion.samples import located
from mapmore_cli.modelling.signals.cycles import last_cycles
from mapmore_cli.spec.sections.data import Between, Holdout
from mapmore_cli.storage.spool import by_blocks

Masks = list[BoolArray]
"""One mask `(n,)` for each part."""


def held_out(parts: Sequence[Part], choice: Holdout | None, levels: LevelSet | None, folder: Path) -> Masks:
    """Return for each part which of its samples are held out; where several conditions are given, all must hold.

    Raises DataError where a condition matches nothing, or where nothing is left to train on.
    """
    if choice is None:
        return [np.zeros(part.size, dtype=np.bool_) for part in parts]
    conditions = _conditions(parts, choice, levels, folder)
    masks = [np.logical_and.reduce(together) for together in zip(*conditions, strict=True)]
    sizes = [int(mask.sum()) for mask in masks]
    if not any(sizes):
        raise DataError("split.validate: no sample fulfils all conditions", _levels_and_recordings(parts, levels))
    if sum(sizes) == sum(part.size for part in parts):
        raise DataError("split.validate: all samples are held out, none is left to train on", _levels_and_recordings(parts, levels))
    return masks


def _conditions(parts: Sequence[Part], choice: Holdout, levels: LevelSet | None, folder: Path) -> list[Masks]:
    conditions = []
    if choice.files is not None:
        conditions.append(
            _matching(parts, choice.files, "files", lambda recording, pattern: _names_file(recording.source, pattern, folder))
        )
    if choice.recordings is not None:
        conditions.append(_matching(parts, choice.recordings, "recordings", lambda r, p: fnmatchcase(r.id, p)))
    for name, values in choice.quantities.items():
        if levels is not None and name == levels.of and not isinstance(values, Between):
            conditions.append(_at_levels(parts, values, levels))
        else:
            conditions.append(_within(parts, name, values))
    if choice.last is not None:
        conditions.append([by_blocks(partial(np.less, 1 - choice.last), part.position) for part in parts])
    if choice.last_cycles is not None and choice.of is not None:
        conditions.append(_last_cycles(parts, choice.of, choice.last_cycles))
    if choice.fraction is not None:
        conditions.append(_random(parts, choice.fraction, choice.seed or 0))
    return conditions


def _matching(parts: Sequence[Part], patterns: Sequence[str], kind: str, matches: Callable[[Recording, str], bool]) -> Masks:
    for pattern in patterns:
        if not any(matches(part.recording, pattern) for part in parts):
            have = dict.fromkeys(part.recording.source if kind == "files" else part.recording.id for part in parts)
            raise DataError(f"split.validate.{kind}: '{pattern}' matches nothing", f"The data have: {', '.join(have)}.")
    return [np.full(part.size, any(matches(part.recording, pattern) for pattern in patterns)) for part in parts]


def _names_file(source: str, pattern: str, folder: Path) -> bool:
    return fnmatchcase(source, relative_name(folder / pattern, folder)) or fnmatchcase(PurePosixPath(source).name, pattern)


def _at_levels(parts: Sequence[Part], values: Sequence[float], levels: LevelSet) -> Masks:
    held = [levels.named(value) for value in values]
    for value, level in zip(values, held, strict=True):
        if level is None:
            raise DataError(f"split.validate: there is no level {levels.of}={value:g}", _levels_and_recordings(parts, levels))
    return [np.full(part.size, part.level in held) for part in parts]


def _within(parts: Sequence[Part], name: str, choice: Sequence[float] | Between) -> Masks:
    """Hold out the samples whose quantity is in one of the intervals, or has one of the values, of which each has to be found somewhere."""
    if isinstance(choice, Between):
        wanted = [(low, high, f"no sample has {name} between {low:g} and {high:g}") for low, high in choice.between]
    else:
        reach = [1e-12 + 1e-9 * abs(value) for value in choice]
        wanted = [(value - r, value + r, f"{name} is nowhere {value:g}") for value, r in zip(choice, reach, strict=True)]
    masks = [np.zeros(part.size, dtype=np.bool_) for part in parts]
    for low, high, complaint in wanted:
        hits = [by_blocks(lambda x, low=low, high=high: (x >= low) & (x <= high), part.columns[name]) for part in parts]
        if not any(hit.any() for hit in hits):
            least, most = min(part.columns[name].min() for part in parts), max(part.columns[name].max() for part in parts)
            remedy = f"{name} runs from {least:g} to {most:g}; give an interval: `{name}: {{between: ...}}`"
            raise DataError(f"split.validate: {complaint}", remedy)
        masks = [mask | hit for mask, hit in zip(masks, hits, strict=True)]
    return masks


def _last_cycles(parts: Sequence[Part], of: str, share: float) -> Masks:
    """Return the last cycles of each log, whose pieces and levels are taken together in the order of time."""
    masks = [np.zeros(part.size, dtype=np.bool_) for part in parts]
    for log in dict.fromkeys(part.log for part in parts):
        members = [number for number, part in enumerate(parts) if part.log == log]
        order = np.argsort(np.concatenate([parts[number].position for number in members]), kind="stable")
        values = np.concatenate([parts[number].columns[of] for number in members])
        held = np.zeros(len(order), dtype=np.bool_)
        with located(f"{parts[members[0]].recording.source}, cycles of {of}"):
            held[order] = last_cycles(values[order], share)
        ends = np.cumsum([parts[number].size for number in members])[:-1]
        for number, mask in zip(members, np.split(held, ends), strict=True):
            masks[number] = mask
    return masks


def _random(parts: Sequence[Part], fraction: float, seed: int) -> Masks:
    """Hold out the nearest whole number of samples to `fraction`, drawn without replacement."""
    edges = np.cumsum([part.size for part in parts])
    chosen = np.zeros(edges[-1], dtype=np.bool_)
    chosen[np.random.default_rng(seed).permutation(edges[-1])[: round(fraction * float(edges[-1]))]] = True
    return np.split(chosen, edges[:-1])


def meant_levels(choice: Holdout | None, levels: LevelSet | None) -> tuple[str, ...]:
    """Return a note for every level that `validate` names by another number than was measured."""
    if choice is None or levels is None or not isinstance(values := choice.quantities.get(levels.of), list):
        return ()
    named = [(value, levels.named(value)) for value in values]
    return tuple(
        f"split.validate: {levels.of} {value:g} is taken as the level {at:g}"
        for value, at in named
        if at is not None and f"{at:g}" != f"{value:g}"
    )


def _levels_and_recordings(parts: Sequence[Part], levels: LevelSet | None) -> str:
    have = "" if levels is None else f"{levels.of} levels {', '.join(f'{level:g}' for level in levels.at)} and "
    return f"The data have {have}recordings {', '.join(dict.fromkeys(part.recording.id for part in parts))}."
