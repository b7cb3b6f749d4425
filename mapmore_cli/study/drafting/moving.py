"""Records of motion, and quantities that nobody knows: a model with memory, of whatever drives on whatever follows."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.recording import Recording
from mapmore_cli.spec.units import is_canonical
from mapmore_cli.study.drafting.columns import Guess, Raw, at_rest_like_air, is_clock, is_state, range_of, twins_of
from mapmore_cli.study.drafting.draft import Draft
from mapmore_cli.study.inspection.evidence import Remembered, read_label, remembered, settling, two_digits, untold

FEWEST = 200  # samples of a record that is worth a model with memory
MOST = 6_000  # samples to which records are resampled: a first try is quick
BREAK = 5  # steps without a sample, that are a gap
UNSETTLED = 0.2  # of the samples, in which the pressure changes: hardly static


def moves(recordings: Sequence[Recording], target: str) -> bool:
    """Return True where a static model has nothing to hold on to: a position under pressure, or a force whose pressure never rests."""
    if sum(one.rows_kept for one in recordings) < FEWEST or "time" not in recordings[0].columns:
        return False
    if target != "force" or "pressure" not in recordings[0].columns:
        return True
    found = settling([(one.columns["time"], one.columns["pressure"]) for one in recordings])
    return found is not None and found.share < 1 - UNSETTLED


HELPS = 0.8  # times the error of the input of now, that earlier ones leave at most where there is memory
WORTH = 0.02  # of the spread of the response: an error below leaves nothing to explain


def remembers(recordings: Sequence[Recording], drive: str, response: str) -> Remembered | None:
    """Return the errors that tell of memory: earlier samples of what drives explain what that of now does not. None where there is none."""
    if min(one.rows_kept for one in recordings) < FEWEST:
        return None
    found = remembered([(one.columns[drive], one.columns[response]) for one in recordings])
    return found if found is not None and found.now > WORTH and found.before < HELPS * found.now else None


def with_counted_samples(draft: Draft, found: Remembered) -> Draft:
    """Return the draft with a sample time, where no column is a clock and the response remembers."""
    told = f"error {found.now:.0%} of its spread by the input of now, {found.before:.0%} by earlier ones as well"
    why = f"s: no column is a clock, and the response remembers ({told}): say how long a sample takes"
    return draft.with_data("sample_time", 1.0, why, False)


def with_memory(draft: Draft, recordings: Sequence[Recording], inputs: Sequence[str], target: str) -> Draft:
    """Return the draft with even steps, and the second half held out."""
    times = [one.columns["time"] for one in recordings if one.rows_kept > 1]
    usual = float(np.median(np.concatenate([np.diff(time) for time in times])))
    total = sum(float(np.ptp(time)) for time in times)
    step = two_digits(max(usual, total / MOST))
    draft = draft.with_data("resample", step, f"s: terms with memory need even steps; the record has one sample in {usual:.3g} s")
    gaps = sum(int(np.count_nonzero(np.diff(time) > BREAK * max(step, usual))) for time in times)
    if gaps or "gaps" in draft.data:
        why = f"s: {gaps} gap{'s' if gaps != 1 else ''}, at which memory begins anew"
        draft = draft.with_data("gaps", {"longer_than": two_digits(BREAK * max(step, usual)), "action": "split"}, why)
    draft = _with_split(draft, recordings, [*inputs, target])
    draft = draft.with_section("target", {"column": target}, "it moves all the time: a model with memory, scored in free run")
    return draft.with_section("validate", {"normaliser": "range"}, "errors are divided by the range: the zero is arbitrary")


STRETCHES = ((0.4, 0.6), (0.25, 0.5), (0.5, 0.75), (0.1, 0.35), (0.65, 0.9))  # of the time, that are held out where the end cannot be
OUTSIDE = 0.05  # of the held-out samples, that may lie beyond what trains
MARGIN, FURTHER = 0.01, 0.05  # of the training range of an input (as `check` has it), and of the target, which overshoots
LAST, MOST_HELD = 0.5, 0.55  # of the samples
MOVED = 0.25  # of the range of the target, that it goes through in what is held out


def _with_split(draft: Draft, recordings: Sequence[Recording], names: Sequence[str]) -> Draft:
    """Return the draft with a hold-out that lies within what trains: the second half, else a stretch of the time."""
    times = [one.columns["time"] for one in recordings]
    outside = _outside(recordings, names, [np.arange(len(time)) >= LAST * len(time) for time in times])
    beyond = f"{outside:.0%} of the second half lies beyond the first one" if outside < 1 else "the second half rests, or is all new"
    if outside <= OUTSIDE:
        return draft.with_data("split", {"validate": {"last": LAST}}, "the second half of every recording is held out")
    low, high = (float(edge(np.concatenate(times))) for edge in (np.min, np.max))
    for begin, end in STRETCHES:
        first, last = (float(f"{low + share * (high - low):.10g}") for share in (begin, end))
        if _outside(recordings, names, [(time >= first) & (time <= last) for time in times]) <= OUTSIDE:
            why = f"s: {beyond}, and this stretch moves within the others"
            return draft.with_data("split", {"validate": {"time": {"between": [[first, last]]}}}, why)
    why = f"{beyond}, and no stretch moves within the others: its error is that of an extrapolation"
    return draft.with_data("split", {"validate": {"last": LAST}}, why, False)


def _outside(recordings: Sequence[Recording], names: Sequence[str], held: Sequence[BoolArray]) -> float:
    """Return the largest share, over quantities, of held-out samples beyond the range of the others; 1 where nothing or most is held out.

    And where the target, the last of the names, hardly moves there: a rest tests nothing.
    """
    kept = np.concatenate(held)
    pooled = {name: np.concatenate([one.columns[name] for one in recordings]) for name in names}
    target = pooled[names[-1]]
    if not kept.any() or np.mean(kept) > MOST_HELD or np.ptp(target[kept]) < MOVED * np.ptp(target):
        return 1.0
    shares = []
    for name, values in pooled.items():
        margin = (FURTHER if name == names[-1] else MARGIN) * float(np.ptp(values[~kept]))
        beyond = (values[kept] < values[~kept].min() - margin) | (values[kept] > values[~kept].max() + margin)
        shares.append(float(np.mean(beyond)))
    return max(shares)


def guess_others(titles: Mapping[str | int, str], raw: Raw, known: Mapping[str, Guess]) -> tuple[dict[str, Guess], list[str], str] | None:
    """Guess what drives and what follows where names say too little; None where not two columns move.

    Returns the columns by names made of their titles, the inputs, and the target. A force follows the position. Pressures drive, all of
    them; without another column they follow the commands. What is left is ranked by how well the drives tell it.
    """
    position = next((one for one in ("strain", "displacement", "length") if one in known and _varies(raw[known[one].column])), None)
    if "force" in known and position is not None and _varies(raw[known["force"].column]) and "pressure" not in known:
        why = f"{known[position].why}; no pressure was found: name its column, `set` it beside the files, or `join` its log"
        guesses = {name: known[name] for name in ("time", position, "force") if name in known}
        return {**guesses, position: replace(known[position], why=why, sure=False)}, [position], "force"
    time = known.get("time") or next((_clock(column, raw) for column in raw if all(map(is_clock, raw[column]))), None)
    moving = {column: values for column, values in raw.items() if _varies(values) and not all(map(is_clock, values))}
    twins = twins_of(moving, known["pressure"].column if "pressure" in known else None)
    columns = [column for column in moving if column not in twins]
    commands = [column for column in columns if (label := read_label(titles.get(column, ""))) is not None and label.quantity == "input"]
    pressures = [one.column for one in pressures_of(titles, {column: moving[column] for column in columns}, known)]
    drives = pressures if [column for column in columns if column not in (*pressures, *commands)] else []
    commands = commands if len(commands) < len(columns) else commands[:1]  # `u_V` and `y_V`: both are volts
    drives = drives or commands or pressures or columns[:1]
    left = [column for column in columns if column not in drives and column not in commands]
    if not drives or not left:
        return None
    force = known["force"].column if "force" in known and known["force"].column in left else None
    if force is not None and position is not None and known[position].column in left and drives == pressures:
        guesses = {} if time is None else {"time": time}
        named = zip(_of_pressures(len(drives)), pressures_of(titles, {column: moving[column] for column in columns}, known), strict=True)
        return (
            {**guesses, **dict(named), position: known[position], "force": known["force"]},
            [*_of_pressures(len(drives)), position],
            "force",
        )
    errors = {column: untold([raw[one] for one in drives], raw[column]) for column in left}
    first = min(errors.values())
    near = [column for column in reversed(left) if errors[column] <= first + CLOSE]
    ranked = [*near, *sorted((column for column in left if column not in near), key=errors.__getitem__)]
    if left[-1] != ranked[0] and titles and errors[left[-1]] < TOLD:
        ranked = [left[-1], *(column for column in ranked if column != left[-1])]  # who names columns puts what matters last
    made = [*drives, ranked[0]]
    of_pressures = [*_of_pressures(len(drives)), *names_of([ranked[0]], titles, ["response"])]
    names = of_pressures if drives == pressures else names_of(made, titles)
    guesses = {} if time is None else {"time": time}
    for name, column in zip(names, made, strict=True):
        is_pressure = column in pressures and drives == pressures
        unit = next((one.unit for one in pressures_of(titles, raw, known) if one.column == column), "1") if is_pressure else "1"
        what = "drives" if column in drives else f"follows: all but {errors[column]:.0%} of it is told by what drives"
        why = f"taken as what {what}{'' if is_pressure else ', without a unit'}; {range_of(raw[column], unit)}"
        guesses[name] = Guess(column, unit, why, False)
    rivals = tuple(
        Guess(column, "1", f"all but {errors[column]:.0%} of it is told by what drives; {range_of(raw[column], '1')}", False)
        for column in ranked[1:]
    )
    guesses[names[-1]] = replace(guesses[names[-1]], rivals=rivals)
    return guesses, names[:-1], names[-1]


TOLD = 0.5  # of the spread of a named column, that what drives leaves at most where the last one is taken
CLOSE = 0.05  # of the spread, that errors differ where the later column is taken
STANDS_STILL = 0.05  # of the range of another pressure


def pressures_of(titles: Mapping[str | int, str], raw: Raw, known: Mapping[str, Guess]) -> list[Guess]:
    """All pressures that move: the known one, others by their titles, and those that rest at an atmosphere as it does.

    Of two that rise and fall together the one that comes later was measured, and the other is its command.
    """
    first = known.get("pressure")
    if first is None or first.column not in raw:
        return []
    found = [first]
    air = at_rest_like_air(raw[first.column])
    for column, values in raw.items():
        label = read_label(titles.get(column, ""))
        by_title = label is not None and label.quantity == "pressure"
        by_value = not titles and air is not None and at_rest_like_air(values) == air
        if column == first.column or not (by_title or by_value):
            continue
        if np.ptp(np.concatenate(values)) > STANDS_STILL * np.ptp(np.concatenate(raw[first.column])):
            unit = label.unit if label is not None and label.unit else first.unit
            found.append(Guess(column, unit, f"a pressure as well; {range_of(values, unit)}", False))
    return found


def _of_pressures(count: int) -> list[str]:
    """Names of so many pressures."""
    return ["pressure", *(f"pressure_{number}" for number in range(2, count + 1))]


def _clock(column: str | int, raw: Raw) -> Guess:
    return Guess(column, "s", f"it never decreases; {range_of(raw[column], 's')}", False)


def _varies(values: Sequence[Array]) -> bool:
    pooled = np.concatenate(values)
    return bool(np.ptp(pooled) > 0) and not is_state(values)


def names_of(columns: Sequence[str | int], titles: Mapping[str | int, str], usual: Sequence[str] = ()) -> list[str]:
    """Names of quantities for columns, each its own; without titles `drive`, `drive_2` ... and `response`, or the `usual` ones."""
    count = len(columns) - 1
    plain = list(usual) or [*(f"drive_{number}" if number > 1 else "drive" for number in range(1, count + 1)), "response"]
    made = [re.sub(r"\W+", "_", titles.get(column, ""), flags=re.ASCII).strip("_")[:40] for column in columns]
    possible = all(re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII) and not is_canonical(name) for name in made)
    return made if possible and len(set(made)) == len(made) else plain
