"""Extract facts about cells, for example errors, from workbooks that are archives of XML (.xlsx,
.ods). The values of the cells are read elsewhere.
"""

from __future__ import annotations

import posixpath
import re
import zipfile
from collections.abc import Collection, Iterator
from io import BytesIO
from xml.etree import ElementTree

from mapmore_cli.storage.workbooks.facts import (
    NEVER_COMPUTED,
    PERCENT,
    PERCENT_BUILT_IN,
    Fact,
    hidden_columns,
    hidden_rows,
    is_percent,
    number_of_letters,
)

BOOK, STYLES = "xl/workbook.xml", "xl/styles.xml"
COLLAPSED = ("collapse", "filter")
OF_XLSX = re.compile(rb"<(\w+:)?f\b|\bt=[\"']e|\b(hidden|ht|zeroHeight)=[\"'](1|true|0)\b")
OF_ODS = re.compile(
    rb"formula=|value-type=\"(?:error|percentage)|spanned=|>Err:|>#|"
    rb"visibility=\"(?:collapse|filter)"
)
"""Pattern of the texts without which a document cannot contain facts about cells. Most documents
contain none of these texts, and need not be parsed.
"""

ERROR = re.compile(r"#\w[\w/]*[!?]?|Err:\d+")


def facts_of(archive: zipfile.ZipFile, title: str) -> Iterator[Fact]:
    """Yield facts about the cells of a sheet, for example errors and hidden rows."""
    names = archive.namelist()
    if BOOK in names:
        content = archive.read(
            part_of_sheet(archive, BOOK, _key_of_sheet(archive.read(BOOK), title))
        )
        percent = _percent_styles(archive)
        in_use = any(re.search(rb"\bs=[\"']%d[\"']" % int(style), content) for style in percent)
        if in_use or OF_XLSX.search(content):
            yield from _facts_of_xlsx(content, percent)
    elif "content.xml" in names:
        content = archive.read("content.xml")
        yield from _facts_of_ods(content, title) if OF_ODS.search(content) else ()


def part_of_sheet(archive: zipfile.ZipFile, book: str, key: str) -> str:
    """Return the path in the archive to which a link of a workbook leads. The link is given by its
    key.
    """
    folder, name = posixpath.split(book)
    links = ElementTree.fromstring(archive.read(f"{folder}/_rels/{name}.rels"))
    part = next(str(link.get("Target")) for link in links if link.get("Id") == key)
    return posixpath.join(folder, part).lstrip("/")


def _key_of_sheet(book: bytes, title: str) -> str:
    """Return the key of the link from a workbook to the sheet with this title."""
    sheets = ElementTree.fromstring(book).iterfind(".//{*}sheet")
    entry = next(sheet for sheet in sheets if sheet.get("name") == title)
    return next(value for name, value in entry.items() if name.endswith("}id"))


def _percent_styles(archive: zipfile.ZipFile) -> frozenset[str]:
    """Return the numbers of the styles of cells that show per cent."""
    if STYLES not in archive.namelist():
        return frozenset()
    styles = ElementTree.fromstring(archive.read(STYLES))
    formats = {
        number_format.get("numFmtId")
        for number_format in styles.iterfind(".//{*}numFmts/{*}numFmt")
        if is_percent(number_format.get("formatCode", ""))
    } | set(map(str, PERCENT_BUILT_IN))
    cells = styles.iterfind("./{*}cellXfs/{*}xf")
    return frozenset(
        str(n) for n, cell_format in enumerate(cells) if cell_format.get("numFmtId") in formats
    )


TRUE = ("1", "true")


def _facts_of_xlsx(content: bytes, percent: Collection[str]) -> Iterator[Fact]:
    """Yield facts about the cells of a sheet: errors, formulas without a value, numbers shown in
    per cent, and hidden rows and columns. `percent` holds the numbers of the styles that show per
    cent.
    """
    row = 0
    for _, node in ElementTree.iterparse(BytesIO(content)):
        space, _, tag = node.tag.rpartition("}")
        if tag == "row":
            row = int(node.get("r", row + 1))
            if node.get("hidden") in TRUE or node.get("ht") == "0":
                yield hidden_rows(row - 1, row - 1)
            node.clear()
        elif tag == "col" and node.get("hidden") in TRUE:
            yield hidden_columns(int(node.get("min", "1")) - 1, int(node.get("max", "1")) - 1)
        elif tag == "c" and (place := re.fullmatch(r"([A-Z]+)(\d+)", node.get("r", ""))):
            kind, value = node.get("t"), node.findtext(f"{space}}}v")
            # an empty text can be the value of a formula (`kind` is then `str`)
            is_open = not value and node.find(f"{space}}}f") is not None
            column, row_of_cell = number_of_letters(place[1]), int(place[2]) - 1
            if node.get("s") in percent:
                yield row_of_cell, column, row_of_cell, column, PERCENT
            if kind == "e" or (is_open and (kind != "str" or value is None)):
                yield row_of_cell, column, row_of_cell, column, value or NEVER_COMPUTED


def _facts_of_ods(content: bytes, title: str) -> Iterator[Fact]:
    """Yield facts about the cells of a sheet: errors, formulas without a value, numbers shown in
    per cent, merged cells, and hidden rows and columns. One element of the file may represent
    several equal rows, columns or cells.
    """
    row, wide, here = 0, 0, False
    for event, node in ElementTree.iterparse(BytesIO(content), ("start", "end")):
        tag = node.tag.rpartition("}")[2]
        if tag == "table" and event == "start":
            row, wide, here = 0, 0, _said(node, "name") == title
        elif tag == "table-column" and event == "end":
            columns = int(_said(node, "number-columns-repeated") or 1)
            if here and _said(node, "visibility") in COLLAPSED:
                yield hidden_columns(wide, wide + columns - 1)
            wide += columns
        elif tag == "table-row" and event == "end":
            rows, column = int(_said(node, "number-rows-repeated") or 1), 0
            if here and _said(node, "visibility") in COLLAPSED:
                yield hidden_rows(row, row + rows - 1)
            for cell in node if here else ():
                columns = int(_said(cell, "number-columns-repeated") or 1)
                end = (row + rows - 1, column + columns - 1)
                for fact in _facts_of_cell(cell):
                    if fact:
                        yield row, column, *end, fact
                    else:
                        down = int(_said(cell, "number-rows-spanned") or 1)
                        right = int(_said(cell, "number-columns-spanned") or 1)
                        yield row, column, row + down - 1, column + right - 1, ""
                column += columns
            row += rows
            node.clear()


def _facts_of_cell(cell: ElementTree.Element) -> Iterator[str]:
    shown = "".join(cell.itertext()).strip()
    kinds = {value for key, value in cell.items() if key.endswith("}value-type")}
    if "error" in kinds or (kinds & {"float", "percentage"} and ERROR.fullmatch(shown)):
        yield shown or "#VALUE!"
    elif _said(cell, "formula") and not kinds:
        yield NEVER_COMPUTED
    elif "percentage" in kinds:
        yield PERCENT
    if {_said(cell, "number-rows-spanned"), _said(cell, "number-columns-spanned")} - {"", "1"}:
        yield ""


def _said(node: ElementTree.Element, name: str) -> str:
    """Return the value of the attribute `name` in any namespace; empty if the attribute does not
    exist.
    """
    return next((value for key, value in node.items() if key.endswith(f"}}{name}")), "")
