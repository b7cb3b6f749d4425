"""State-space models of motion."""

from __future__ import annotations

from collections.abc import Iterator

from mapmore_cli.domain.motion import BUMPLESS, CARRIED, HARD, REST, ZERO, Motion, MotionFit, MotionSection, SectionSearch
from mapmore_cli.storage.artefacts.codecs import adapted, added, shown, text
from mapmore_cli.storage.artefacts.layout.cells import ASCENDING, REALS, SPAN, TEXTS
from mapmore_cli.storage.artefacts.layout.derived import stored
from mapmore_cli.storage.artefacts.schema import Fault

BOUNDARIES = adapted(ASCENDING, store=list, load=lambda array: tuple(array.tolist()))

MOTION_SECTION = stored(MotionSection, {"weights": REALS})


def _motion_faults(motion: Motion) -> Iterator[Fault]:
    wanted = (len(motion.boundaries) + 1) * (2 if motion.directed else 1)
    if len(motion.sections) != wanted:
        yield "sections", f"has {len(motion.sections)} sections, where the boundaries make {wanted}"
    if not motion.step > 0:
        yield "step", "is not positive"
    if motion.drives[:1] != (motion.input,):
        yield "drives", f"does not begin with the input {shown(motion.input)}"
    for number, section in enumerate(motion.sections):
        if len(section.weights) != len(motion.drives):
            yield f"sections/{number}/weights", f"has {len(section.weights)} values for {len(motion.drives)} drives"


def _motion_fit_faults(fit: MotionFit) -> Iterator[Fault]:
    if len(fit.searches) != len(fit.model.sections):
        yield "searches", f"has {len(fit.searches)} searches for {len(fit.model.sections)} sections"


MOTION = stored(
    Motion,
    {
        "switching": text(words=(HARD, CARRIED, BUMPLESS)),
        "boundaries": BOUNDARIES,
        "limits": SPAN,
        "start": added(text(words=(REST, ZERO)), REST),
    },
    rule=_motion_faults,
)

SECTION_SEARCH = stored(SectionSearch, {"history": REALS})

MOTION_FIT = stored(MotionFit, {"notes": TEXTS}, rule=_motion_fit_faults)
