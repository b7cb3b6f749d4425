"""Model motion by the piecewise state-space models of Brown and Xie 2024: linear sections of second
order along an input, for example the voltage of a pressure regulator.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mapmore_cli.annexes.motion.body import MotionFit, StateSpace
from mapmore_cli.annexes.motion.problem import MotionSettings
from mapmore_cli.modelling.kinds import Kind, Verbs

if TYPE_CHECKING:
    from mapmore_cli.cli.console import View
    from mapmore_cli.domain.fits import Fit
    from mapmore_cli.domain.models import Model
    from mapmore_cli.fitting.kinds import Maker
    from mapmore_cli.reporting.sections import PageSection
    from mapmore_cli.reporting.table import Table
    from mapmore_cli.study.diagnostics import Finding
    from mapmore_cli.study.experiment import ExperimentSpec


@dataclass(frozen=True)
class MotionKind(Kind):
    """The kind of models of motion. The other files of this package are imported only when they are
    needed.
    """

    def maker(self) -> Maker:
        """Return the object that fits models of motion."""
        from mapmore_cli.annexes.motion.fitted import MotionMaker

        return MotionMaker()

    def findings(self, spec: ExperimentSpec) -> Iterator[Finding]:
        """Check a spec whose model is a state-space model of motion."""
        from mapmore_cli.annexes.motion.checks import findings

        return findings(spec)

    def section(self) -> PageSection:
        """Return the section of a run's page about models of motion."""
        from mapmore_cli.annexes.motion.page import SECTION

        return SECTION

    def show_fit(self, fit: Fit) -> tuple[dict[str, object], tuple[Table, ...]]:
        """Return what `mapmore show` prints about a fit."""
        from mapmore_cli.annexes.motion.page import show_fit

        return show_fit(fit)

    def show(self, model: Model, show_other: Callable[[Model], View]) -> View:  # noqa: ARG002
        """Return what `mapmore show` prints about a model."""
        from mapmore_cli.annexes.motion.page import show

        return show(model)


def _verbs() -> Verbs:
    from mapmore_cli.annexes.motion.model import MotionVerbs

    return MotionVerbs()


KIND = MotionKind(
    "state_space", StateSpace, MotionFit, _verbs, over_time=True, settings=MotionSettings
)
