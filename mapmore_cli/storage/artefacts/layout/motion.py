"""State-space models of motion."""

from __future__ import annotations

from collections.abc import Iterator

from mapmore_cli.domain.motion import BUMPLESS, CARRIED, HARD, REST, ZERO, Motion, MotionFit, MotionSection, SectionSearch
from mapmore_cli.storage.artefacts.codecs import adapted, added, numbered, text
from mapmore_cli.storage.artefacts.label import NO_UNIT
from mapmore_cli.storage.artefacts.layout.cells import ASCENDING, COUNT, FLAG, REAL, REALS, SPAN, TEXT, TEXTS
from mapmore_cli.storage.artefacts.layout.derived import completed
from mapmore_cli.storage.artefacts.schema import Fault, Field, Schema, record

BOUNDARIES = adapted(ASCENDING, store=list, load=lambda array: tuple(array.tolist()))

MOTION_SECTION = Schema(
    MotionSection,
    "A linear section: `x1[k+1] = x2[k]`, `x2[k+1] = P1 x1[k] + P2 x2[k] + sum_m w_m d_m[k]`, output x1 (P eq 10, in discrete time).",
    (
        Field("id", TEXT, "identifier of the section, as `2` or `rise 2`", NO_UNIT),
        Field("place", COUNT, "place along the input, from 1", NO_UNIT),
        Field("direction", TEXT, "direction of the input in which it holds: `all`, `rise` or `fall`", NO_UNIT),
        Field("p1", REAL, "P1"),
        Field("p2", REAL, "P2"),
        Field("weights", REALS, "(m) weights of the drives; the first is P3", "[target] over the unit of the drive"),
    ),
)


def _motion_faults(motion: Motion) -> Iterator[Fault]:
    wanted = (len(motion.boundaries) + 1) * (2 if motion.directed else 1)
    if len(motion.sections) != wanted:
        yield "sections", f"has {len(motion.sections)} sections, where the boundaries make {wanted}"
    if not motion.step > 0:
        yield "step", "is not positive"
    for number, section in enumerate(motion.sections):
        if len(section.weights) != len(motion.drives):
            yield f"sections/{number}/weights", f"has {len(section.weights)} values for {len(motion.drives)} drives"


def _motion_fit_faults(fit: MotionFit) -> Iterator[Fault]:
    if len(fit.searches) != len(fit.model.sections):
        yield "searches", f"has {len(fit.searches)} searches for {len(fit.model.sections)} sections"


MOTION = completed(
    Schema(
        Motion,
        "Sections along an input (P eq 14-17).",
        (
            Field("input", TEXT, "the input", NO_UNIT),
            Field("output", TEXT, "the predicted quantity", NO_UNIT),
            Field("step", REAL, "time between samples", "s"),
            Field(
                "switching",
                text(words=(HARD, CARRIED, BUMPLESS)),
                "`hard`: sections run side by side; `carried`, `bumpless`: they share one state",
                NO_UNIT,
            ),
            Field("boundaries", BOUNDARIES, "inputs at which sections meet, ascending", "that of the input"),
            Field("directed", FLAG, "1 where sections differ between a rising and a falling input"),
            Field("dead_band", REAL, "how far the input turns back before its direction changes", "that of the input"),
            Field("drives", TEXTS, "(m) terms that drive every section, the input first", NO_UNIT),
            Field("sections", numbered(record(MOTION_SECTION)), "in order along the input, `rise` before `fall`", NO_UNIT),
            Field("limits", SPAN, "least and greatest training input", "that of the input"),
            Field("start", added(text(words=(REST, ZERO)), REST), "a run begins at `rest` under its first input, or at `zero`", NO_UNIT),
        ),
        rule=_motion_faults,
    )
)

SECTION_SEARCH = Schema(
    SectionSearch,
    "How the parameters of one section were found.",
    (
        Field("section", TEXT, "identifier of the section", NO_UNIT),
        Field("samples", COUNT, "training samples at which it holds"),
        Field("rmse", REAL, "error over these, before sections were joined", "[target]"),
        Field("evaluations", COUNT, "simulations that it took"),
        Field("history", REALS, "lowest error so far, from the start on", "[target]"),
    ),
)

MOTION_FIT = completed(
    Schema(
        MotionFit,
        "A model of motion, and how each of its sections was found.",
        (
            Field("model", record(MOTION), "the model", NO_UNIT),
            Field("solver", TEXT, "name of the solver", NO_UNIT),
            Field("searches", numbered(record(SECTION_SEARCH)), "the search of each section, in the order of sections", NO_UNIT),
            Field("notes", TEXTS, "remarks for the reader", NO_UNIT),
        ),
        rule=_motion_fit_faults,
    )
)
