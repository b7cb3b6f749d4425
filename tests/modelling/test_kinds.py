"""What every kind of model can do is one typed object, also of a kind that somebody adds."""

# ruff: noqa: ARG002 - verbs of a kind that says 0 look at nothing

from dataclasses import dataclass

import numpy as np
import pytest

from mapmore_cli.domain.models import Body, Model, Outputs
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.domain.results import SimulatedRun
from mapmore_cli.fitting.kinds import FittedKind, maker_of
from mapmore_cli.modelling import kinds
from mapmore_cli.modelling.kinds import Kind, Verbs


@dataclass(frozen=True)
class Zero(Body):
    """A model that says 0."""


class ZeroVerbs(Verbs):
    """What it does; all else it inherits."""

    def simulate(self, model, columns):
        return SimulatedRun(0.0 * columns["pressure"])

    def equations(self, model, units):
        return ()

    def parameters(self, model):
        return 0

    def write(self, m, model, inputs):
        return m.let("zero", 0.0 * inputs["pressure"])


def test_a_kind_defines_four_verbs_and_inherits_the_others(monkeypatch):
    added = Kind("zero", Zero, None, ZeroVerbs)
    monkeypatch.setattr(kinds, "kinds", lambda: (added,))
    model = Model("zero", Quantity("force", "N"), (Quantity("pressure", "kPa"),), Zero())
    columns = {"pressure": np.array([1.0, 2.0])}
    for verb in (kinds.predict, kinds.settled, kinds.one_step_ahead):
        assert verb(model, columns).tolist() == [0.0, 0.0]
    assert kinds.outside_range(model, columns).tolist() == [False, False]
    assert (kinds.rules(model), kinds.fed_back(model), kinds.running(model)) == ((), (), None)


@pytest.mark.parametrize("verb", ["simulate", "equations", "parameters", "write"])
def test_a_kind_that_lacks_a_verb_is_no_kind(verb):
    lacking = {name: one for name, one in vars(ZeroVerbs).items() if name != verb}
    with pytest.raises(TypeError, match=verb):
        type("Lacking", (Verbs,), lacking)()


@pytest.mark.parametrize("kind", kinds.kinds(), ids=lambda kind: kind.name)
def test_no_kind_defines_a_verb_that_nobody_asks_for(kind):
    own = type(kind.verbs())
    assert Verbs in own.__mro__
    assert {name for name in vars(own) if not name.startswith("_")} <= {*vars(Verbs)}
    if isinstance(kind, FittedKind):
        assert type(maker_of(kind.name)) is type(kind.maker())


def test_several_outputs_are_a_model_of_each():
    inputs, body = (Quantity("pressure", "kPa"),), Zero()
    force, strain = (Model("zero", Quantity(name, "1"), inputs, body) for name in ("F", "eps"))
    both = Model("both", force.output, inputs, Outputs((force, strain)))
    assert both.each == (force, strain)
    assert force.each == (force,)
    assert [both.of(name) for name in ("F", "eps", "none")] == [force, strain, both]
    assert force.of("eps") == force
    assert both.outputs == (force.output, strain.output)
