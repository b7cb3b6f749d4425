"""Write a model in C as a header, a source file and a small test program. For a model without
memory, write also its derivatives and its inverse, which finds the input for a wanted output.

The inverse takes the same steps as `modelling.inverse`. MuJoCo and Simulink call the C code through
wrappers.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from mapmore_cli.annexes.exporting.dialect import DOUBLE, SINGLE, Dialect
from mapmore_cli.annexes.exporting.program_text import program_words
from mapmore_cli.annexes.exporting.templates import (
    Code,
    Wanted,
    code,
    identifier,
    name_of_output,
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
from mapmore_cli.modelling.kinds import runs_over_time
from mapmore_cli.modelling.program.slopes import with_slopes
from mapmore_cli.modelling.program.statements import Program
from mapmore_cli.modelling.programs import program_of
from mapmore_cli.modelling.ranges import OUTSIDE_TOLERANCE

MOST_INPUTS = 14
"""Largest number of inputs. The number that the C function returns has one bit for each input and a
further bit, and an `int` may have only 16 bits.
"""

STATUS = (NONE, ONE, SEVERAL, FLAT)
"""Meanings of the return values 0, 1, 2 and 3 of an inverse function."""

DIVIDED = 64
"""Largest number of parts of an input's range that the inverse in C divides further. The limit is
needed because the ends of the new parts must fit on the stack; Python has no such limit.
"""

COARSER = 1000.0
"""Factor by which the tolerances of the inverse are larger in single precision."""

SEARCH = {
    "status": STATUS,
    **{"DIVIDED": DIVIDED, "SPLITS": SPLITS, "BISECTIONS": BISECTIONS},
    **{"STEEP": STEEP, "SAME": SAME, "REACHED": REACHED},
}
"""Constants of the search in the templates of the inverse."""


def c_files(model: Model, wanted: Wanted) -> dict[str, str]:
    """Return the C files of a model. If there is a compiler, compare their results with
    `predict`.
    """
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
    """Return a model in C, optionally in single precision.

    Raises UsageError if the model's name has no character that C allows, or if the model has too
    many inputs; DataError if a part of it has no closed expression.
    """
    if len(model.inputs) > MOST_INPUTS:
        raise UsageError(
            f"{model.name} has {len(model.inputs)} inputs, but a model in C can have at most "
            f"{MOST_INPUTS}, because the number that the C function returns has one bit for each",
            "use fewer inputs; if the model is a sum, export each of its parts alone",
        )
    name, program = identifier(model.name), program_of(model)
    dialect = SINGLE if single else DOUBLE
    names, prefix = names_of_inputs(model.inputs), word(name.upper())
    outputs = names_of_inputs(model.outputs) if len(model.each) > 1 else {}
    words = {
        "model": model,
        "name": name,
        "prefix": prefix,
        "places": {
            quantity: code("{}_IN_{}", prefix, in_code.upper())
            for quantity, in_code in names.items()
        },
        "outputs": [code("{}_OUT_{}", prefix, in_code.upper()) for in_code in outputs.values()],
        "into": [code("out[{}]", i) for i in range(len(outputs))] or [code("*out")],
        "notes": notes_of(model, names),
        "number": dialect.number,
        "tolerance": dialect.number(OUTSIDE_TOLERANCE),
        "real": word("float" if single else "double"),
        "single": single,
        "f": Code("f" * single),
        "function": "eval" if program.step is None else "step",
        "inverses": (),
        "inverse": None,
    }
    return CSource(name, program, dialect, words | program_words(program, dialect, apart=False))


class CSource(NamedTuple):
    """A model in C: the `name` of its functions, its program, its dialect, and `words`, the values
    of the variables in the templates.
    """

    name: Code
    program: Program
    dialect: Dialect
    words: dict[str, Any]

    @property
    def files(self) -> dict[str, str]:
        """Header, source and a small test program, by name. If the model has one output and no
        memory, there are also the derivatives of the model, and its inverse along every input
        whose training range is known.
        """
        name, words = self.name, self.words
        files = {f"{name}.h": rendered_template("model.h", **words), f"{name}.c": functions(words)}
        files[f"{name}_main.c"] = rendered_template("main.c", **words)
        if words["memory"] or words["outputs"]:
            return files
        slopes = program_words(with_slopes(self.program), self.dialect, apart=False)
        inverses = list(_inverses(words))
        ends = max([inverse["ends"] for inverse in inverses], default=0) + 2 * DIVIDED
        into = [*words["into"], *(code("slopes[{}]", i) for i in range(len(words["places"])))]
        words = {**words, **slopes, **SEARCH, "inverses": inverses, "ends": ends, "into": into}
        words |= {"function": "derivatives", "coarser": COARSER if words["single"] else 1.0}
        words["helpers"] |= self.dialect.helpers("sign_of(" * bool(inverses))
        files[f"{name}_inverse.h"] = rendered_template("inverse.h", **words)
        files[f"{name}_inverse.c"] = functions(words)
        return files


def functions(words: Mapping[str, Any]) -> str:
    """Return the C code of the functions of a model, made from their template."""
    return rendered_template("model.c", **words, body=rendered_template("body.c", **words))


def _inverses(words: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield the values of the variables in the template of an inverse function, once for every
    input with a known training range. The function finds this input for a wanted output.
    """
    for name, in_code in names_of_inputs(words["model"].inputs).items():
        try:
            places = knots(words["model"], name)
        except UsageError:
            continue
        parts = parts_between(places)
        yield {
            "own": in_code,
            "place": words["places"][name],
            "knots": list(map(words["number"], places.tolist())),
            "parts": parts,
            "ends": 2 * (len(places) - 1) * (parts + 1) + 1,
        }


def mujoco_files(model: Model, _wanted: Wanted) -> dict[str, str]:
    """Return the C code of a model of pressure and strain, with a callback from which MuJoCo gets
    the force of an actuator.

    Raises UsageError for a model with other inputs, or with memory.
    """
    inputs = {quantity.name: quantity.unit for quantity in model.inputs}
    if (
        runs_over_time(model)
        or set(inputs) != {"pressure", "strain"}
        or model.output.name != "force"
    ):
        raise UsageError(
            "an actuator of MuJoCo needs a model of the force with the inputs pressure and strain",
            "export this model as py, and call it in a callback",
        )
    if (inputs["strain"], model.output.unit) != ("1", "N"):
        raise UsageError(
            "MuJoCo needs the strain as a fraction and the force in N",
            "run the study with `units: {strain: 1, force: N}`",
        )
    source = c_source(model)
    text = rendered_template("mujoco.c", **source.words, pressure=inputs["pressure"])
    return {**source.files, f"{source.name}_mujoco.c": text}


def simulink_files(model: Model, _wanted: Wanted) -> dict[str, str]:
    """Return the C code of a model and a function of single numbers for a C Caller block.

    Raises UsageError for a model with memory, because a C Caller block keeps no state.
    """
    if runs_over_time(model):
        raise UsageError(
            "`--to simulink` writes a function for a C Caller block, which cannot keep the memory "
            "of this model from one call to the next",
            "write `--to fmu`, and import the FMU into Simulink",
        )
    source = c_source(model)
    used = [f"{source.name}_{form}" for form in ("eval", "valid", *names_of_inputs(model.outputs))]
    names = names_of_inputs(model.inputs, [source.name, *used, "out"])
    words = source.words | {"output": name_of_output(model), "names": names.values()}
    words["parameters"] = [code("double {}", name) for name in names.values()]
    forms = ("simulink.h", "simulink.c")
    return source.files | {
        f"{source.name}_{form}": rendered_template(form, **words) for form in forms
    }
