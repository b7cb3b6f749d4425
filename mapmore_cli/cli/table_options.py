"""Declare and read the options of `predict`, `invert` and `adapt` for tables that another program
wrote.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Option

from mapmore_cli.domain.errors import DataError, UsageError

if TYPE_CHECKING:
    from mapmore_cli.pipeline.foreign import TableOptions

Delimiter = Annotated[
    str | None,
    Option(metavar="MARK", help="What separates fields: a character, tab or whitespace."),
]
Decimal = Annotated[
    str | None, Option(metavar="MARK", help="The decimal point, for example a comma.")
]
Thousands = Annotated[
    str | None, Option(metavar="MARK", help="The separator of thousands, for example a point.")
]
SheetTitle = Annotated[
    str | None, Option("--sheet", metavar="TITLE", help="The sheet to read from a workbook.")
]
Columns = Annotated[
    list[str],
    Option(
        "--columns",
        metavar="NAME=TITLE",
        help="The title or 0-based index of a column, for example pressure='P [bar]'. Repeatable.",
    ),
]
Units = Annotated[
    list[str],
    Option(
        "--units",
        metavar="NAME=UNIT",
        help="The unit of a column, for example pressure=bar. Repeatable.",
    ),
]


def table_options(
    delimiter: str | None,
    decimal: str | None,
    thousands: str | None,
    sheet: str | None,
    columns: Sequence[str],
    units: Sequence[str],
) -> TableOptions:
    """Return the options for reading a table. Raises UsageError for a `--columns` or `--units`
    without `=`.
    """
    from mapmore_cli.pipeline.foreign import TableOptions

    keys = {"delimiter": delimiter, "decimal": decimal, "thousands": thousands, "sheet": sheet}
    settings: dict[str, Any] = {key: value for key, value in keys.items() if value is not None}
    titles = {
        name: int(title) if title.isascii() and title.isdigit() else title
        for name, title in _pairs("--columns", columns)
    }
    # units contain no commas, so one `--units` may hold several pairs, separated by commas
    each = [part for text in units for part in text.split(",")]
    return TableOptions(settings, titles, dict(_pairs("--units", each)))


def _pairs(option: str, texts: Sequence[str]) -> Iterator[tuple[str, str]]:
    for text in texts:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not (name and equals and value):
            example = "pressure=bar" if option == "--units" else "pressure='P [bar]'"
            raise UsageError(
                f"{option} {text}: is not of the form NAME=...", f"write `{option} {example}`"
            )
        yield name, value


BY_OPTIONS = (
    "Keys are options here: `--delimiter`, `--decimal`, `--thousands` and `--sheet` with the same "
    "values, `--columns NAME=TITLE` (or an index) and `--units NAME=UNIT`."
)


@contextmanager
def remedies_by_options(table: Path | None) -> Iterator[None]:
    """If reading the table fails, add a line to the remedy of the error. The line says which
    options replace the keys of a spec. No line is added for errors of the model or of stdin,
    because these options do not apply to them.
    """
    try:
        yield
    except DataError as error:
        if table is not None and error.message.startswith((str(table), table.name)):
            error.remedy = "\n  ".join([*filter(None, [error.remedy]), BY_OPTIONS])
        raise
