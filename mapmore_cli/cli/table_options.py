"""Read the options of `predict` and `invert` for tables that another program wrote."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
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
    # units contain no commas, so several may follow one `--units`
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


CLAUSE = "(?:`[^`]*`|[^.;`])*"
"""Text to the end of a clause. Points within backquotes belong to a key, and end no clause."""

AS_OPTIONS = (
    (", or list it in `missing: [^`]*`", ""),
    (
        "`(thousands: [^`]*)` at the column, or, [^`]*`(decimal: [^`]*)` and `[^`]*` in `data`",
        r"`\1` and `\2`",
    ),
    (r"`(delimiter|decimal|thousands|sheet): ([^`]+)`", r"`--\1 \2`"),
    (r"name the sheet to read with `sheet`", "name the sheet to read with `--sheet TITLE`"),
    (r"Give its 0-based index instead", "Give its 0-based index, for example `--columns NAME=0`"),
    (r"name it in `columns`, for example `unit: (\w+)`", r"name it with `--units NAME=\1`"),
    (r"`unit: ([^`]+)`", r"`--units NAME=\1`"),
    (rf"{CLAUSE}`(?:columns|(?:missing|header|scale|encoding)[^`]*)`{CLAUSE}(?:[.;]|$) ?", ""),
)
"""Parts of remedies for a spec, and their replacements for a table that is read by options."""


@contextmanager
def remedies_by_options(options: TableOptions) -> Iterator[None]:
    """Let the remedies of errors in a table name options instead of keys of a spec."""
    try:
        yield
    except DataError as error:
        remedy = error.remedy or ""
        for pattern, by_option in AS_OPTIONS:
            remedy = re.sub(pattern, by_option, remedy)
        found = re.search(r"read as (\w+)|column '?(\w+)'?", error.message)
        titled = (
            name
            for name, title in options.columns.items()
            if f"column {title}" in error.message or f"'{title}'" in error.message
        )
        name = next(titled, (found[1] or found[2]) if found is not None else "NAME")
        if "there is no column" in error.message and "--" not in remedy:
            near = re.search("Did you mean '([^']*)'", remedy)
            title = near[1] if near is not None else "TITLE"
            remedy += (
                f" Name the right column, for example with `--columns NAME='{title}' "
                "--units NAME=UNIT`."
            )
        remedy = remedy.replace("NAME", name)
        error.remedy = remedy.strip() or "correct the table"
        raise
