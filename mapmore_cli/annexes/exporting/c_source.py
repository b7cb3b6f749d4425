"""A model in C: header, source and a small program; without memory its derivatives too, and the
input for a wanted output.

The inverse is that of `modelling.inverse`, in the same steps. MuJoCo and Simulink call the C by
wrappers.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from mapmore_cli.annexes.exporting.dialect import DOUBLE, SINGLE, Dialect, program_words
from mapmore_cli.annexes.exporting.templates import (
    Code,
    Wanted,
    code,
    identifier,
    names_of_inputs,
    notes_of,
    rendered_template,
    word,
)
from mapmore_cli.annexes.exporting.verifying import (
    CLOSE,
    CLOSE_SINGLE,
    CompilerMissing,
    verify_program,
)
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.models import Model
from mapmore_cli.modelling.inverse import (
    BISECTIONS,
    FLAT,
    NONE,
    ONE,
    REACHED,
    SAME,
    SEVERAL,
    SPLITS,
    STEEP,
    knots,
    parts_between,
)
from mapmore_cli.modelling.kinds import OUTSIDE_TOLERANCE, runs_over_time
from mapmore_cli.modelling.program.model import program_of, with_slopes
from mapmore_cli.modelling.program.statements import Program

MOST_INPUTS = 14
"""Bits of the returned number, one for every input and one more: an `int` may have 16."""

STATUS = (NONE, ONE, SEVERAL, FLAT)
"""What the inverse functions return, from 0."""

DIVIDED = 64
"""Parts of a scan that are divided further at most, so that its places have room on the stack;
Python knows no such limit.
"""

COARSER = 1000.0
"""Times wider limits of the inverse in single precision."""

SEARCH = {
    "status": STATUS,
    **{"DIVIDED": DIVIDED, "SPLITS": SPLITS, "BISECTIONS": BISECTIONS},
    **{"STEEP": STEEP, "SAME": SAME, "REACHED": REACHED},
}
"""What the templates of the inverse know of the search."""


def c_files(model: Model, wanted: Wanted) -> dict[str, str]:
    """Return the C of a model, compared with `predict` where there is a compiler."""
    source = c_source(model, wanted.single)
    if wanted.verify:
        compiled = [f"{source.name}.c", f"{source.name}_main.c"]
        try:
            close = CLOSE_SINGLE if wanted.single else CLOSE
            verify_program(model, source.files, compiled, close)
        except CompilerMissing as reason:
            wanted.warn(f"{reason}: the source was not compared with `mapmore predict`")
    return source.files


def c_source(model: Model, single: bool = False) -> CSource:
    """Return a model in C, in single precision if so wished.

    Raises UsageError where the model's name has nothing that C allows, or it has too many inputs;
    DataError where a part of it is no closed expression.
    """
    if len(model.inputs) > MOST_INPUTS:
        raise UsageError(
            f"{model.name} has {len(model.inputs)} inputs; one bit each leaves room for "
            f"{MOST_INPUTS}",
            "export its parts",
        )
    return CSource(model, program_of(model), identifier(model.name), SINGLE if single else DOUBLE)


@dataclass(frozen=True)
class CSource:
    """A model as the text of its files; `name` is that of its functions."""

    model: Model
    code: Program
    name: Code
    dialect: Dialect

    @cached_property
    def words(self) -> dict[str, Any]:
        """What templates know of the model."""
        names, single = names_of_inputs(self.model.inputs), self.dialect is SINGLE
        outputs = names_of_inputs(self.model.outputs) if len(self.model.each) > 1 else {}
        prefix = word(self.name.upper())
        return {
            **program_words(self.code, self.dialect, apart=False),
            "model": self.model,
            "name": self.name,
            "prefix": prefix,
            "places": {name: code("{}_IN_{}", prefix, own.upper()) for name, own in names.items()},
            "outputs": [code("{}_OUT_{}", prefix, own.upper()) for own in outputs.values()],
            "into": [code("out[{}]", i) for i in range(len(outputs))] or [code("*out")],
            "notes": notes_of(self.model, names),
            "number": self.dialect.number,
            "tolerance": self.dialect.number(OUTSIDE_TOLERANCE),
            "real": word("float" if single else "double"),
            "single": single,
            "f": Code("f" * single),
            "function": "eval" if self.code.step is None else "step",
            "inverses": (),
            "inverse": None,
        }

    @cached_property
    def files(self) -> dict[str, str]:
        """Header, source and a small program to try the model with, by name; of one output without
        memory also its derivatives, and the input for a wanted output where ranges are known.
        """
        name, words = self.name, self.words
        files = {f"{name}.h": self.header(), f"{name}.c": _source(words)}
        files[f"{name}_main.c"] = rendered_template("main.c", **words)
        if words["memory"] or words["outputs"]:
            return files
        slopes = program_words(with_slopes(self.code), self.dialect, apart=False)
        inverses = list(self._inverses())
        ends = max([one["ends"] for one in inverses], default=0) + 2 * DIVIDED
        into = [*words["into"], *(code("slopes[{}]", i) for i in range(len(words["places"])))]
        words = {**words, **slopes, **SEARCH, "inverses": inverses, "ends": ends, "into": into}
        words["function"] = "derivatives"
        words["coarser"] = COARSER if words["single"] else 1.0
        files[f"{name}_inverse.h"] = rendered_template("inverse.h", **words)
        files[f"{name}_inverse.c"] = _source(words)
        return files

    def header(self) -> str:
        """Return the declarations, with names and units."""
        return rendered_template("model.h", **self.words)

    def source(self) -> str:
        """Return the functions."""
        return _source(self.words)

    def _inverses(self) -> Iterator[dict[str, Any]]:
        """Yield what the function that solves for an input needs, for every one whose training
        range is known.
        """
        for name, own in names_of_inputs(self.model.inputs).items():
            try:
                places = knots(self.model, name)
            except UsageError:
                continue
            parts = parts_between(places)
            yield {
                "own": own,
                "place": self.words["places"][name],
                "knots": [self.dialect.number(place) for place in places.tolist()],
                "parts": parts,
                "ends": 2 * (len(places) - 1) * (parts + 1) + 1,
            }


def _source(words: Mapping[str, Any]) -> str:
    return rendered_template("model.c", **words, body=rendered_template("body.c", **words))


# Around the C of a model: an actuator of MuJoCo, and a function for Simulink's C Caller
# -------------------------------------------------


def mujoco_files(model: Model, _wanted: Wanted) -> dict[str, str]:
    """Return the C of a model of pressure and strain, and a callback that MuJoCo asks for the force
    of an actuator.

    Raises UsageError for a model with other inputs, or with memory.
    """
    inputs = {quantity.name: quantity.unit for quantity in model.inputs}
    if (
        runs_over_time(model)
        or set(inputs) != {"pressure", "strain"}
        or model.output.name != "force"
    ):
        raise UsageError(
            "an actuator of MuJoCo is a force by pressure and strain",
            "export this model as py, and call it in a callback",
        )
    if (inputs["strain"], model.output.unit) != ("1", "N"):
        raise UsageError(
            "MuJoCo counts in m and N", "run the study with `units: {strain: 1, force: N}`"
        )
    source = c_source(model)
    text = rendered_template("mujoco.c", **source.words, pressure=inputs["pressure"])
    return {**source.files, f"{source.name}_mujoco.c": text}


def simulink_files(model: Model, _wanted: Wanted) -> dict[str, str]:
    """Return the C of a model, and a function of single numbers that a C Caller block calls.

    Raises UsageError for a model with memory: a C Caller block keeps no state.
    """
    if runs_over_time(model):
        raise UsageError(
            "a C Caller block keeps no state, and this model has memory",
            "export it as fmu, which Simulink imports",
        )
    source = c_source(model)
    names = names_of_inputs(model.inputs, [source.name])
    words = source.words | {"output": identifier(model.output.name), "names": names.values()}
    words["parameters"] = [code("double {}", name) for name in names.values()]
    forms = ("simulink.h", "simulink.c")
    return source.files | {f"{source.name}_{one}": rendered_template(one, **words) for one in forms}
