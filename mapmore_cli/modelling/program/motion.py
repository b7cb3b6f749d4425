"""Write models of motion as statements: sections with states of their own, or with a shared one (P eq 10-17)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from mapmore_cli.domain.motion import BUMPLESS, HARD, REST, Motion, MotionSection
from mapmore_cli.modelling.program.statements import Block, Keep, Kept
from mapmore_cli.modelling.program.writing import Lines, kept_number, less, renamed_all, times, total
from mapmore_cli.modelling.terms import Expression, Number, add, parse, power
from mapmore_cli.modelling.terms.syntax import ONE, ZERO, Condition


def motion_value(lines: Lines, motion: Motion, inputs: Mapping[str, Expression], kept: Kept) -> Expression:
    """The model's output at a sample; it begins at rest under the first one's input, or at zero."""
    seen = kept_number(kept, lines, "seen")
    first = Condition(seen, "==", ZERO)
    drives = [lines.let("drive", one) for one in renamed_all(map(parse, motion.drives), inputs)]
    section = _section(lines, motion, inputs[motion.input], kept, first)
    write = _separate if motion.switching == HARD else _shared
    value = write(lines, motion, section, drives, kept, first)
    lines.statements.append(Keep(seen.name, ONE))
    return value


def _section(lines: Lines, motion: Motion, u: Expression, kept: Kept, first: Condition) -> Expression:
    """Number of the section that holds, from 0, as `regimes.active` has it."""
    places = [(Condition(u, "<", Number(boundary)), Number(float(place))) for place, boundary in enumerate(motion.boundaries)]
    place = lines.choose("place", places, Number(float(len(motion.boundaries))))
    if not motion.directed:
        return place
    falls = _falls(lines, u, kept, first) if motion.switching != BUMPLESS else _falls_latched(lines, motion, u, kept, first)
    return lines.let("section", total([times(Number(2.0), place), falls]))


def _falls(lines: Lines, u: Expression, kept: Kept, first: Condition) -> Expression:
    """1 unless the input is above the one before (P eq 16)."""
    before = kept_number(kept, lines, "input")
    falls = lines.choose("falls", [(first, ONE), (Condition(u, ">", before), ZERO)], ONE)
    lines.statements.append(Keep(before.name, u))
    return falls


def _falls_latched(lines: Lines, motion: Motion, u: Expression, kept: Kept, first: Condition) -> Expression:
    """1 once the input has turned down by more than the dead band, up to when it has turned up as far."""
    play, falling = kept_number(kept, lines, "play"), kept_number(kept, lines, "falling")
    half = Number(0.5 * motion.dead_band)
    low, high = lines.let("low", less(u, half)), lines.let("high", add(u, half))
    up, down = Condition(low, ">", play), Condition(high, "<", play)
    moved = lines.choose("play", [(first, u), (up, low), (down, high)], play)
    falls = lines.choose("falls", [(first, ZERO), (up, ZERO), (down, ONE)], falling)
    lines.statements += [Keep(play.name, moved), Keep(falling.name, falls)]
    return falls


def _separate(lines: Lines, motion: Motion, section: Expression, drives: list[Expression], kept: Kept, first: Condition) -> Expression:
    """Every section runs on the whole input; the output is that of the section that holds."""
    outputs = []
    for one in motion.sections:
        origin, now, later = (kept_number(kept, lines, stem) for stem in ("origin", "now", "later"))
        drive = lines.let("driven", _driven(one, drives))
        began = lines.choose("began", [(first, drive)], origin) if motion.start == REST else ZERO
        x1, z = (lines.choose(stem, [(first, ZERO)], name) for stem, name in (("moved", now), ("ahead", later)))
        rest = lines.let("rest", times(began, power(Number(1.0 - one.p1 - one.p2), -1)))
        outputs.append(lines.let("output", add(x1, rest)))
        following = lines.let("following", total([z, times(Number(one.p2), x1)]))
        ahead = lines.let("coming", total([lines.let("way", less(drive, began)), times(Number(one.p1), x1)]))
        lines.statements += [Keep(origin.name, began), Keep(now.name, following), Keep(later.name, ahead)]
    return _of_section(lines, "motion", section, outputs)


def _shared(lines: Lines, motion: Motion, section: Expression, drives: list[Expression], kept: Kept, first: Condition) -> Expression:
    """The section that holds drives one state on."""
    now, later = kept_number(kept, lines, "now"), kept_number(kept, lines, "later")

    def of_each(result: Callable[[Lines, MotionSection], Expression]) -> list[Expression | Block]:
        blocks: list[Expression | Block] = []
        for one in motion.sections:
            own = Lines(lines.names)
            blocks.append(own.block(result(own, one)))
        return blocks

    resting = of_each(lambda own, one: times(own.let("driven", _driven(one, drives)), power(Number(1.0 - one.p1 - one.p2), -1)))
    rest = _of_section(lines, "rest", section, resting) if motion.start == REST else ZERO
    x1, x2 = (lines.choose(stem, [(first, rest)], name) for stem, name in (("output", now), ("ahead", later)))

    def following(own: Lines, one: MotionSection) -> Expression:
        past = own.let("past", total([times(Number(one.p2), x2), times(Number(one.p1), x1)]))
        return total([own.let("driven", _driven(one, drives)), past])

    after = _of_section(lines, "following", section, of_each(following))
    lines.statements += [Keep(now.name, x2), Keep(later.name, after)]
    return x1


def _driven(section: MotionSection, drives: list[Expression]) -> Expression:
    return total([times(Number(weight), drive) for weight, drive in zip(section.weights.tolist(), drives, strict=True)])


def _of_section(lines: Lines, stem: str, section: Expression, values: Sequence[Expression | Block]) -> Expression:
    """The value of the section that holds."""
    cases = [(Condition(section, "==", Number(float(number))), value) for number, value in enumerate(values[:-1])]
    return lines.choose(stem, cases, values[-1])
