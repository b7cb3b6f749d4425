"""The tables of docs/file-format.md, made from the declarations of the stored types.

`python -m mapmore_cli.storage.artefacts.describe docs/file-format.md` brings the page up to date; a test fails when it is not.
"""

from __future__ import annotations

import sys
from pathlib import Path

from mapmore_cli.storage.artefacts.label import NO_UNIT
from mapmore_cli.storage.artefacts.layout import SCHEMAS
from mapmore_cli.storage.artefacts.schema import Field, Schema

START, END = "<!-- stored types: start -->\n", "<!-- stored types: end -->\n"


def described(page: str) -> str:
    """Return the page with its part between the two markers made anew."""
    head, rest = page.split(START)
    tail = rest.split(END)[1]
    return f"{head}{START}\n{''.join(map(_section, SCHEMAS))}{END}{tail}"


def _section(schema: Schema) -> str:
    rows = "".join(_row(field) for field in schema.fields)
    return f"### {schema.type.__name__}\n\n{schema.summary}\n\n| name | stored as | unit | what it is |\n|---|---|---|---|\n{rows}\n"


SHORT = (
    ("string attribute", "`text`"),
    ("float64 attribute", "`float`"),
    ("int64 attribute", "`int`"),
    ("string dataset, 1-D", "`text[]`"),
    ("float64 dataset, 1-D", "`float[]`"),
    ("float64 dataset, 2-D", "`float[,]`"),
    ("int64 dataset, 1-D", "`int[]`"),
    ("uint8 dataset, 1-D", "`flag[]`"),
    ("`names` and `values`; values: ", "`names`/`values` "),
    ("named group of: ", "named "),
    ("numbered group of: ", "numbered "),
    ("group with the attribute `kind`; ", ""),
    (", a dataset for every column", ""),
    (" (MAY be absent)", " ?"),
)
"""The page's short words for how a field is stored; its head says what they mean."""


def _form(form: str) -> str:
    for long, short in SHORT:
        form = form.replace(long, short)
    return form


def _row(field: Field) -> str:
    unit = NO_UNIT if field.unit == NO_UNIT else f"`{field.unit}`"
    remark = " (derived)" if field.derived else ""
    what = f"{field.description}{remark}".replace("|", "\\|")
    return f"| `{field.name}` | {_form(field.codec.form)} | {unit} | {what} |\n"


if __name__ == "__main__":
    page = Path(sys.argv[1])
    page.write_text(described(page.read_text(encoding="utf-8")), encoding="utf-8")
