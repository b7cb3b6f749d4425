"""Implement `mapmore adapt`, which adapts the model of a family of muscles to one specimen."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from mapmore_cli.cli.console import (
    NONE,
    AsJson,
    Quiet,
    View,
    members,
    output_option,
    print_view,
)
from mapmore_cli.cli.model_tables import constants_of, lines_for
from mapmore_cli.cli.progress import Reporter
from mapmore_cli.cli.table_options import (
    Columns,
    Decimal,
    Delimiter,
    SheetTitle,
    Thousands,
    Units,
    remedies_by_options,
    table_options,
)
from mapmore_cli.storage.inputs import note_read

if TYPE_CHECKING:
    from mapmore_cli.domain.models import Model

ADAPTED = Path("adapted.h5")
"""Name of the model that `adapt` writes if no other is given."""


def adapt(
    model_file: Annotated[Path, Argument(metavar="MODEL", help="The model.h5 of a family.")],
    table: Annotated[
        Path | None,
        Argument(
            metavar="[TABLE]",
            help="A table of a few measured points (pressure, strain and force), which is read "
            "like that of `predict`.",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        output_option(f"The model to write. Default: {ADAPTED}."),
    ] = None,
    given: Annotated[
        list[str],
        Option(
            "--set",
            metavar="NAME=VALUE",
            help="The property in which specimens differ, for example length=250 mm.",
        ),
    ] = NONE,
    delimiter: Delimiter = None,
    decimal: Decimal = None,
    thousands: Thousands = None,
    sheet: SheetTitle = None,
    columns: Columns = NONE,
    units: Units = NONE,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Adapt the model of a family to a specimen with a few points.

    The force is multiplied by one factor and the strain by another. Both factors are expected to be
    near 1 (prior: 1 +- 15 %). The new model has the inputs pressure and strain, and can be used
    like any other model. Without a TABLE, the new model is computed only from the dimension that
    --set gives, and its intervals are the intervals of the family.
    """
    from mapmore_cli.pipeline.adapting import adapt, dimension_of, names_of_points
    from mapmore_cli.storage.artefacts import read_model, write_model
    from mapmore_cli.storage.outputs import note_chosen, refuse_early

    chosen, output = output is None, output or ADAPTED
    if chosen:
        refuse_early(output, chosen)
    options = table_options(delimiter, decimal, thousands, sheet, columns, units)
    with Reporter(quiet) as reporter:
        family = read_model(model_file, reporter.warn)
        dimension_of(family)
        lines, label = None, ""
        if table is not None:
            note_read([table])
            ways = [names_of_points(family)]
            lines, label = lines_for(table, family, ways, options, reporter)
        with remedies_by_options(table):
            model = adapt(family, lines, label, constants_of(family, given))
    write_model(output, model)
    if chosen:
        note_chosen(output.parent, [output.name])
    print_view(_view(model, output), as_json)


def _view(model: Model, output: Path) -> View:
    """Return the view of an adapted model: the two fitted factors with their standard errors, and
    the path of the model.
    """
    from mapmore_cli.reporting.table import Table

    fit = model.backbone
    assert fit is not None
    columns = ("scale", "value", "standard error")
    rows = [(name, value, fit.errors[name]) for name, value in fit.parameters.items()]
    notes = (fit.errors_note, *model.notes)
    table = Table.of("adapted", f"{model.name}, adapted", columns, rows, *notes)
    document = {
        "model": str(output),
        **members(fit, "parameters", "errors", "errors_note", "samples"),
        "notes": model.notes,
    }
    return View(document, (table,), (f"model: {output}",))
