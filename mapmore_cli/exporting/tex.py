"""The equations of a model as a fragment of LaTeX."""

from __future__ import annotations

from mapmore_cli.domain.foreign import tex_comment, tex_text
from mapmore_cli.domain.models import Model
from mapmore_cli.exporting.dialect import identifier
from mapmore_cli.modelling.kinds import equations


def tex_equations(model: Model) -> tuple[str, str]:
    """Return name and text of a file for `\\input`: one equation each, in the model's units, with what it is called before it."""
    units = ", ".join(f"{quantity.name} in {quantity.unit}" for quantity in (model.output, *model.inputs))
    lines = tex_comment(f"{model.name}: {units}")
    for one in equations(model):
        lines += [rf"\noindent {tex_text(one.id)}:", r"\[", f"  {one.latex}", r"\]"]
    return f"{identifier(model.name)}.tex", "\n".join([*lines, ""])
