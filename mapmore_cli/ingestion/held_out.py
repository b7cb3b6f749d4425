"""Decide which samples are held out for the validation."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np

from mapmore_cli.domain.arrays import BoolArray, by_blocks, row_numbers
from mapmore_cli.domain.errors import DataError
from mapmore_cli.ingestion.curves import LevelPart, LevelSet
from mapmore_cli.ingestion.globs import is_file_named
from mapmore_cli.ingestion.samples import located
from mapmore_cli.modelling.signals.cycles import last_cycles
from mapmore_cli.study.sections.split import Between, Holdout


def held_out(
    parts: Sequence[LevelPart], choice: Holdout | None, levels: LevelSet | None, folder: Path
) -> list[BoolArray]:
    """Return a mask for each part, (n,), that is True for held-out samples. A sample is held out if
    it fulfils all conditions in `choice`.

    Raises DataError if a condition matches nothing, or if no sample is left for training.
    """
    if choice is None:
        return [np.zeros(part.size, dtype=np.bool_) for part in parts]
    held = np.logical_and.reduce([*_conditions(parts, choice, levels, folder)])
    if not held.any():
        raise DataError(
            "split.validate: no sample fulfils all conditions",
            _levels_and_recordings(parts, levels),
        )
    if held.all():
        raise DataError(
            "split.validate: all samples are held out, so that none is left for training",
            _levels_and_recordings(parts, levels),
        )
    return np.split(held, np.cumsum([part.size for part in parts])[:-1])


def _conditions(
    parts: Sequence[LevelPart], choice: Holdout, levels: LevelSet | None, folder: Path
) -> Iterator[BoolArray]:
    """Yield a mask for each condition in `choice`, (n,). It is True for the samples that fulfil the
    condition. The n samples are those of all parts, one part after the other.
    """

    def is_named(source: str, pattern: str) -> bool:
        return is_file_named(source, pattern, folder)

    sizes = [part.size for part in parts]
    if choice.files is not None:
        yield np.repeat(
            _matching("files", choice.files, [part.recording.source for part in parts], is_named),
            sizes,
        )
    if choice.recordings is not None:
        yield np.repeat(
            _matching(
                "recordings", choice.recordings, [part.recording.id for part in parts], fnmatchcase
            ),
            sizes,
        )
    for name, values in choice.quantities.items():
        if levels is not None and name == levels.of and not isinstance(values, Between):
            yield np.repeat(_at_levels(parts, values, levels), sizes)
        else:
            yield _within(parts, name, values)
    if choice.last is not None:
        yield np.concatenate([part.behind(1 - choice.last) for part in parts])
    if choice.last_cycles is not None:
        assert choice.of is not None  # a spec with one of both keys only is refused
        yield _last_cycles(parts, choice.of, choice.last_cycles)
    # `fraction` of the number of samples is rounded to a whole number
    if choice.fraction is not None:
        drawn = np.random.default_rng(choice.seed or 0).permutation(sum(sizes))[
            : round(choice.fraction * sum(sizes))
        ]
        yield np.isin(np.arange(sum(sizes)), drawn)


def _matching(
    kind: str, patterns: Sequence[str], names: Sequence[str], matches: Callable[[str, str], bool]
) -> list[bool]:
    """Return, for each name, True if one of the patterns selects it.

    A pattern is first compared with the names as a plain text, and then as a glob if no name is
    equal to it. This order is needed because brackets can be part of a name (`book[Run1]`) as well
    as of a glob. Raises DataError for a pattern that selects no name.
    """
    held: set[str] = set()
    for pattern in patterns:
        meant = {pattern} & {*names} or {name for name in names if matches(name, pattern)}
        if not meant:
            raise DataError(
                f"split.validate.{kind}: '{pattern}' matches nothing",
                f"The data contain: {', '.join(dict.fromkeys(names))}.",
            )
        held |= meant
    return [name in held for name in names]


def _at_levels(parts: Sequence[LevelPart], values: Sequence[float], levels: LevelSet) -> list[bool]:
    held = [levels.named(value) for value in values]
    for value, level in zip(values, held, strict=True):
        if level is None:
            raise DataError(
                f"split.validate: there is no level {levels.of}={value:g}",
                _levels_and_recordings(parts, levels),
            )
    return [part.level in held for part in parts]


def _within(parts: Sequence[LevelPart], name: str, choice: Sequence[float] | Between) -> BoolArray:
    """Return a mask, (n,), of the samples of all parts. It is True if the quantity `name` lies in
    one of the intervals of `choice`, or has one of its values. Raises DataError if one of the
    intervals contains no sample, or if one of the values does not occur.
    """
    if isinstance(choice, Between):
        wanted = [
            (low, high, f"no sample has {name} between {low:g} and {high:g}")
            for low, high in choice.between
        ]
    else:
        reach = [1e-12 + 1e-9 * abs(value) for value in choice]
        wanted = [
            (value - r, value + r, f"{name} is never {value:g}")
            for value, r in zip(choice, reach, strict=True)
        ]
    masks = []
    for low, high, complaint in wanted:
        hits = [
            by_blocks(lambda x, low=low, high=high: (x >= low) & (x <= high), part.columns[name])
            for part in parts
        ]
        masks.append(np.concatenate(hits))
        if not masks[-1].any():
            least, most = (
                min(part.columns[name].min() for part in parts),
                max(part.columns[name].max() for part in parts),
            )
            remedy = (
                f"{name} goes from {least:g} to {most:g}; give an interval: `{name}: "
                f"{{between: ...}}`"
            )
            raise DataError(f"split.validate: {complaint}", remedy)
    held: BoolArray = np.any(masks, axis=0)
    return held


def _last_cycles(parts: Sequence[LevelPart], of: str, share: float) -> BoolArray:
    """Return a mask, (n,), of the samples of all parts. It is True for the samples in the last
    cycles of each log; `share` is the fraction of cycles. Before the cycles are counted, all parts
    of a log are put together in the order of time.
    """
    sources = {part.log: part.recording.name for part in reversed(parts)}
    log = np.repeat([part.log for part in parts], [part.size for part in parts])
    places = np.concatenate([row_numbers(part.places) for part in parts])
    values = np.concatenate([part.columns[of] for part in parts])
    held = np.zeros(len(log), dtype=np.bool_)
    for number in dict.fromkeys(part.log for part in parts):
        members = np.flatnonzero(log == number)
        in_order = members[np.argsort(places[members], kind="stable")]
        with located(f"{sources[number]}, cycles of {of}"):
            held[in_order] = last_cycles(values[in_order], share)
    return held


def meant_levels(choice: Holdout | None, levels: LevelSet | None) -> list[str]:
    """Return a note for every level that `split.validate` names by a rounded value, for example by
    150 for the measured level 149.73.
    """
    if (
        choice is None
        or levels is None
        or not isinstance(values := choice.quantities.get(levels.of), list)
    ):
        return []
    named = ((f"{value:g}", levels.named(value)) for value in values)
    return [
        f"split.validate: for {levels.of} {value}, the level {at:g} is held out"
        for value, at in named
        if at is not None and f"{at:g}" != value
    ]


def _levels_and_recordings(parts: Sequence[LevelPart], levels: LevelSet | None) -> str:
    have = (
        ""
        if levels is None
        else f"{levels.of} levels {', '.join(f'{level:g}' for level in levels.at)} and "
    )
    return (
        f"The data have {have}recordings "
        f"{', '.join(dict.fromkeys(part.recording.id for part in parts))}."
    )
