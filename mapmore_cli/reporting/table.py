"""Define tables as data, and write them as CSV, text, Markdown, LaTeX or HTML. Also provide what
all pages use: the templates, and readable names of models.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Literal

from mapmore_cli.domain.foreign import csv_cell, printable, tex_comment, tex_text
from mapmore_cli.modelling.learners import LEARNERS
from mapmore_cli.modelling.simple import SIMPLE

if TYPE_CHECKING:
    from jinja2 import Environment

Cell = str | int | float | None
"""Contents of a cell. None and NaN stand for a missing number."""

Cells = tuple[Cell, ...]
"""A row of a table."""

MISSING = "–"
EQUATION = r"{{\raggedright\strut ${}$\strut\par}}"

CODE = re.compile("`([^`]+)`")
"""Regular expression for a command or a key in a sentence."""

WRITTEN = re.compile(r"(.*?)(?: \[(.*?)\])?(?: (#?\.\d+\w))?", re.DOTALL)


@dataclass(frozen=True)
class Column:
    """Column of a table.

    - `unit`: unit of the numbers; empty if the table shows none.
    - `spec`: format of numbers with a decimal point.
    - `form`: `text` for equations as text, which LaTeX tables leave out; `source` for equations as
      LaTeX source, which LaTeX tables typeset; `model` for names of models; `cell` for everything
      else.
    """

    name: str
    unit: str = ""
    spec: str = "#.4g"
    form: Literal["cell", "text", "source", "model"] = "cell"

    @classmethod
    def of(cls, text: str) -> Column:
        """Return the column that a text such as `RMSE [N] .3g` describes: its name, its unit and
        its format. Unit and format may be left out.
        """
        parts = WRITTEN.fullmatch(text)
        assert parts is not None
        name, unit, spec = parts.groups()
        return cls(name, unit or "", spec or cls.spec)

    @property
    def heading(self) -> str:
        """Heading of the column: its name with its unit, for example `RMSE [N]`."""
        return f"{self.name} [{self.unit}]" if self.unit not in ("", "1") else self.name


Columns = Iterable[Column | str]
"""Columns of a table; a text such as `RMSE [N] .3g` is converted by `Column.of`."""

MODEL = Column("model", form="model")
FROM_TO = ("from", "to")
"""Words for the lower and the upper end of a range in headings."""


@dataclass(frozen=True, repr=False)
class Table:
    """Table with named columns. It is shown as text, and in notebooks as HTML.

    - `name`: stem of its file name, for example `scores`.
    - `rows`: a tuple for each row, with as many cells as there are `columns`.
    - `notes`: sentences that a reader of the table must know.
    """

    name: str
    title: str
    columns: tuple[Column, ...]
    rows: tuple[Cells, ...]
    notes: tuple[str, ...] = ()

    @classmethod
    def of(
        cls, name: str, title: str, columns: Columns, rows: Iterable[Sequence[Cell]], *notes: str
    ) -> Table:
        """Return a table. A text in `columns` is split into name, unit and format. A name that
        comes from the user must therefore be passed as a Column, because it could contain brackets.
        """
        heads = tuple(
            Column.of(column) if isinstance(column, str) else column for column in columns
        )
        return cls(name, title, heads, tuple(map(tuple, rows)), notes)

    def __post_init__(self) -> None:
        if any(len(row) != len(self.columns) for row in self.rows):
            raise ValueError(
                f"table {self.name!r}: a row is not as long as the {len(self.columns)} columns"
            )

    def __repr__(self) -> str:
        return to_text(self).rstrip()

    def _repr_html_(self) -> str:
        return to_html(self)

    @property
    def records(self) -> list[dict[str, Cell]]:
        """The rows as dictionaries; the keys are the headings of the columns."""
        return [dict(zip(self.headings, row, strict=True)) for row in self.rows]

    @property
    def headings(self) -> tuple[str, ...]:
        """Column headings with their units."""
        return tuple(column.heading for column in self.columns)

    def head(self, most: int) -> Table:
        """Return the table with its first `most` rows only, and with a note that names the file
        with all rows. A shorter table is returned unchanged.
        """
        if len(self.rows) <= most:
            return self
        note = f"The first {most} of {len(self.rows)} rows; all are in tables/{self.name}.csv."
        return replace(self, rows=self.rows[:most], notes=(*self.notes, note))

    @cached_property
    def numeric(self) -> tuple[bool, ...]:
        """For each column, True if it contains numbers; such columns are aligned to the right."""
        return tuple(
            any(isinstance(row[j], int | float) for row in self.rows)
            for j in range(len(self.columns))
        )

    @property
    def shown(self) -> tuple[tuple[str, ...], ...]:
        """Cells as readable texts, row by row."""
        return tuple(
            tuple(_show(cell, column) for cell, column in zip(row, self.columns, strict=True))
            for row in self.rows
        )


def is_missing(cell: Cell) -> bool:
    """Return True if a number is missing."""
    return cell is None or (isinstance(cell, float) and math.isnan(cell))


def cells_of(record: object, columns: Mapping[str, str]) -> tuple[Any, ...]:
    """Return the values of attributes of a record. `columns` holds the names of the attributes by
    the headings of their columns, for example `{"weight [%]": "weight"}`. If the heading has the
    unit `%`, the fraction is converted to per cent.

    The unit of the target may also be `%`, but then the number is no fraction. A heading therefore
    contains `UNIT` in place of the unit of the target; `with_unit` fills it in afterwards.
    """
    numbers = attrgetter(*columns.values())(record)
    return tuple(
        100 * x if "[%" in heading else x for heading, x in zip(columns, numbers, strict=True)
    )


def with_unit(headings: Iterable[str], unit: str) -> tuple[str, ...]:
    """Return headings in which the unit of the target replaces `UNIT`."""
    return tuple(heading.replace("UNIT", unit) for heading in headings)


def _show(cell: Cell, column: Column) -> str:
    if is_missing(cell):
        return MISSING
    return format(cell, column.spec).removesuffix(".") if isinstance(cell, float) else str(cell)


def to_csv(table: Table) -> str:
    """Return the table as comma-separated text, with units in the header, 12 significant digits,
    and an empty field for a missing number.
    """
    return rows_to_csv(
        map(csv_cell, table.headings), ([number_text(cell) for cell in row] for row in table.rows)
    )


def rows_to_csv(headings: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return headings and rows as comma-separated text with Unix line ends."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([headings, *rows])
    return text.getvalue()


def number_text(cell: Cell, digits: int = 12) -> str:
    """Return the text of a cell for CSV. A number has `digits` significant digits, and the text of
    a missing number is empty.
    """
    if is_missing(cell):
        return ""
    if isinstance(cell, str):
        return csv_cell(cell)
    return format(cell, f".{digits}g") if isinstance(cell, float) else str(cell)


def to_text(table: Table) -> str:
    """Return the table as plain text with aligned columns, its title above and its notes below."""
    columns = list(zip(table.headings, *table.shown, strict=True))
    aligned = []
    for cells, number in zip(columns, table.numeric, strict=True):
        width = max(map(len, cells))
        head, *others = (cell.rjust(width) if number else cell.ljust(width) for cell in cells)
        aligned.append([head, "-" * width, *others])
    lines = ["  ".join(line).rstrip() for line in zip(*aligned, strict=True)]
    return "\n".join([table.title, "", *lines, *table.notes]) + "\n"


_MARKUP = re.compile(
    r"[\\`*|~$]"
    r"|(?<![A-Za-z0-9])_|_(?![A-Za-z0-9])"  # `_` is escaped only at the ends of a word
    r"|\](?=[(\[:])"  # `]` is escaped only where it could end a link
    r"|(?<=:)/(?=/)|(?<=www)\."  # web addresses must not become links
    # at the start of a text, these characters would begin a heading, a list, a quotation or a rule
    r"|^(?:>|[-+](?=\s|$)|[#=-]+(?=\s|$))"
)


def markdown_text(text: str) -> str:
    """Return the text on one line. Special characters of Markdown are escaped, so that it shows the
    text unchanged.
    """
    text = printable(" ".join(text.split())).replace("&", "&amp;").replace("<", "&lt;")
    return re.sub(r"^(\d+)([.)])(?=\s|$)", r"\1\\\2", _MARKUP.sub(r"\\\g<0>", text))


def to_markdown(table: Table, text: Callable[[str], str] = markdown_text) -> str:
    """Return a Markdown table with its title in bold above and its notes below. The function `text`
    escapes every title, heading, cell and note.
    """
    rule = tuple("---:" if number else "---" for number in table.numeric)
    written = [tuple(map(text, line)) for line in (table.headings, *table.shown)]
    lines = [f"| {' | '.join(line)} |" for line in (written[0], rule, *written[1:])]
    return (
        "\n".join(
            [f"**{text(table.title)}**", "", *lines, *(f"\n{text(note)}" for note in table.notes)]
        )
        + "\n"
    )


def to_latex(table: Table) -> str:
    """Return a LaTeX `tabular` with typeset equations and the lines of the package booktabs. Title
    and notes are comments. The document needs `\\usepackage{booktabs}`.
    """
    kept = [j for j, column in enumerate(table.columns) if column.form != "text"]
    sources = [j for j in kept if table.columns[j].form == "source"]
    # all columns of equations together have three quarters of the width of the page
    equation = rf"p{{{0.75 / max(len(sources), 1):.3g}\linewidth}}"
    numbers = ["r" if number else "l" for number in table.numeric]
    align = "".join(equation if j in sources else numbers[j] for j in kept)
    head = [
        heading.replace("latex", "equation") if j in sources else heading
        for j, heading in enumerate(table.headings)
    ]
    rows = [
        [EQUATION.format(line[j]) if j in sources else tex_text(line[j]) for j in kept]
        for line in table.shown
    ]
    lines = [" & ".join(line) + r" \\" for line in ([tex_text(head[j]) for j in kept], *rows)]
    frame = [
        *tex_comment(table.title, *table.notes),
        rf"\begin{{tabular}}{{{align}}}",
        r"\toprule",
        lines[0],
        r"\midrule",
    ]
    return "\n".join([*frame, *lines[1:], r"\bottomrule", r"\end{tabular}"]) + "\n"


def to_html(table: Table) -> str:
    """Return an HTML `<table>` with its title as caption. The first cell of a row is the heading of
    the row.

    Names of models are replaced by their titles, also in headings.
    """
    return environment().get_template("table.html").render(table=table, title_of=title_of).strip()


OTHERS = {**{name: learner.title for name, learner in LEARNERS.items()}, **SIMPLE}


@lru_cache(maxsize=10_000)
def title_of(text: str) -> str:
    """Return the title of a model (`Sárosi, hinged` for `sarosi_hinged`). For a sum such as `a+b`,
    return the titles of all models in it. A text that names no known model is returned unchanged.
    """
    # imported only here, because most tables need no formulas
    from mapmore_cli.modelling import literature

    names = text.split("+")
    titles = [
        OTHERS.get(name) or (literature.get(name).title if name in literature.names() else "")
        for name in names
    ]
    return text if "" in titles else " + ".join(titles)


@cache
def environment() -> Environment:
    """Return the Jinja environment with the templates of the package. Its filters write tables,
    figures and sentences as HTML.
    """
    # imported only here, because text tables and figures do not need Jinja
    from jinja2 import (
        Environment,
        PackageLoader,
        StrictUndefined,
    )
    from markupsafe import Markup, escape

    loader = PackageLoader("mapmore_cli.reporting")
    templates = Environment(
        loader=loader,
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    templates.filters["table"] = lambda table: Markup(to_html(table))
    templates.filters["svg"] = lambda figure: Markup(figure.svg)
    templates.filters["code"] = lambda text: Markup(CODE.sub(r"<code>\1</code>", str(escape(text))))
    return templates
