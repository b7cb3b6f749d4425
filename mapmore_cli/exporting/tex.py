"""The equations of a model as a fragment of LaTeX."""

from __future__ import annotations

from mapmore_cli.domain.models import Model
from mapmore_cli.exporting.names import identifier
from mapmore_cli.modelling.kinds import equations

SPECIAL = {char: f"\\{char}" for char in "&%$#_{}"} | {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"}


def tex_equations(model: Model) -> tuple[str, str]:
    """Name and text of a file for `\\input`: one equation each, in the model's units, with what it is called before it."""
    units = ", ".join(f"{quantity.name} in {quantity.unit}" for quantity in (model.output, *model.inputs))
    lines = [f"% {model.name}: {units}"]
    for one in equations(model):
        lines += [rf"\noindent {escaped(one.id)}:", r"\[", f"  {one.latex}", r"\]"]
    return f"{identifier(model.name)}.tex", "\n".join([*lines, ""])


def escaped(text: str) -> str:
    """Text as TeX prints it."""
    return "".join(SPECIAL.get(char, char) for char in text)
