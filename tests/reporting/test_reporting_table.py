import csv
import io
import math
from html.parser import HTMLParser

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from mapmore_cli.domain.foreign import printable
from mapmore_cli.modelling import literature
from mapmore_cli.reporting.table import (
    OTHERS,
    Column,
    Table,
    environment,
    title_of,
    to_csv,
    to_html,
    to_markdown,
    to_text,
)

TABLE = Table(
    "demo",
    "A & B",
    (Column("model"), Column("RMSE", "N"), Column("ratio", "1", ".2f"), Column("n")),
    (("a_1", 12.345678901234567, 0.5, 3), ("b|<i>", math.nan, None, 12)),
    ("A note.",),
)


def test_units_stand_in_the_headings_but_not_the_unit_one():
    assert TABLE.headings == ("model", "RMSE [N]", "ratio", "n")


def test_people_see_rounded_numbers_and_a_dash_where_there_is_none():
    assert TABLE.shown == (("a_1", "12.35", "0.50", "3"), ("b|<i>", "–", "–", "12"))


def test_rounding_keeps_trailing_zeros_but_no_bare_point():
    table = Table("t", "t", (Column("x"),), ((6.85,), (1011.0,), (20.0,)))
    assert [row[0] for row in table.shown] == ["6.850", "1011", "20.00"]


def test_csv_has_twelve_digits_and_empty_fields():
    lines = to_csv(TABLE).splitlines()
    assert lines == ["model,RMSE [N],ratio,n", "a_1,12.3456789012,0.5,3", "b|<i>,,,12"]


def test_the_head_of_a_table_says_how_many_rows_there_are():
    assert TABLE.head(2) is TABLE
    (note, more), rows = TABLE.head(1).notes, TABLE.head(1).rows
    assert (note, rows) == ("A note.", TABLE.rows[:1])
    assert more == "The first 1 of 2 rows; all are in tables/demo.csv."


def test_ragged_rows_are_refused():
    with pytest.raises(ValueError, match="as long as the 2 columns"):
        Table("t", "t", (Column("x"), Column("y")), ((1,),))


def test_text_columns_line_up():
    lines = to_text(TABLE).splitlines()
    assert lines[0] == "A & B"
    assert lines[-1] == "A note."
    heading, rule, *rows = lines[2:-1]
    assert {len(line) for line in (heading, rule, *rows)} == {len(heading)}
    # numbers end where their heading ends
    assert rows[0].index("12.35") + 5 == heading.index("RMSE [N]") + 8


def test_markdown_escapes_the_pipe_and_aligns_numbers():
    lines = to_markdown(TABLE).splitlines()
    assert lines[3] == "| --- | ---: | ---: | ---: |"
    assert "b\\|&lt;i>" in lines[5]


MARKUP = [
    "<script>",
    "</b>",
    "&lt;",
    "[a](b)",
    "![a](b)",
    "[a]: b",
    "**",
    "_",
    "`",
    "$",
    "~~",
    "https://a.b",
    "www.a.b",
]
MARKUP += [
    "# ",
    "- ",
    "1. ",
    "> ",
    "\\",
    "<!--",
    "|",
    "---",
    "===",
    "<img src=x onerror=y>",
    "\n",
    " ",
    "a",
]


@example("1. ")
@example("12. a")
@given(st.lists(st.sampled_from(MARKUP) | st.text(max_size=3), max_size=6).map("".join))
def test_markdown_prints_a_text_and_does_nothing_else(text):
    """As a reader of CommonMark with tables, links, strikethrough and raw HTML takes it: in title,
    heading, cell and note.
    """
    table = to_markdown(
        Table("t", f"t{text}t", (Column(f"h{text}"), Column("n")), ((f"{text}", 1.0),), (text,))
    )
    found = MarkdownIt("commonmark", {"html": True}).enable(["table", "strikethrough"]).parse(table)
    kinds = {one.type for block in found for one in (block, *(block.children or ()))}
    known = {
        f"{name}_{end}"
        for name in ("table", "thead", "tbody", "tr", "th", "td", "paragraph", "strong")
        for end in ("open", "close")
    }
    assert kinds <= {*known, "inline", "text", "text_special"}, kinds
    said = [
        "".join(one.content for one in block.children) for block in found if block.type == "inline"
    ]
    shown = printable(" ".join(text.split()))
    assert said.count(shown) == 2 if shown else True


def test_long_paths_may_break_and_short_ones_may_not():
    html = to_html(
        Table(
            "t",
            "t",
            (Column("file"), Column("model")),
            (("../data/a_b/<recording>_12.csv", "a/b"),),
        )
    )
    assert "../<wbr>data/<wbr>a_b/<wbr>&lt;recording&gt;_12.csv" in html
    assert "<td>a/b</td>" in html


class Cells(HTMLParser):
    def __init__(self):
        super().__init__()
        self.scopes = []
        self.rows = []

    def handle_starttag(self, tag, attrs):
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")
        if tag == "th":
            self.scopes.append(dict(attrs).get("scope"))

    def handle_data(self, data):
        if self.rows and self.rows[-1]:
            self.rows[-1][-1] += data.strip("\n")


def test_html_cells_are_the_shown_ones_with_scoped_headings():
    cells = Cells()
    cells.feed(to_html(TABLE))
    assert [tuple(row) for row in cells.rows] == [TABLE.headings, *TABLE.shown]
    assert cells.scopes == ["col"] * 4 + ["row"] * 2


texts = st.text(
    st.characters(codec="utf-8", exclude_categories=("Cc", "Cf", "Zl", "Zp")), max_size=12
)
numbers = st.floats(allow_nan=False, allow_infinity=False)


@given(st.lists(st.tuples(texts, numbers, st.integers(), st.none()), min_size=1, max_size=5))
def test_csv_parses_back(rows):
    table = Table(
        "t", "t", (Column("text"), Column("x", "N"), Column("n"), Column("none")), tuple(rows)
    )
    read = list(csv.reader(io.StringIO(to_csv(table))))
    assert read[0] == ["text", "x [N]", "n", "none"]
    for (text, x, n, _), cells in zip(rows, read[1:], strict=True):
        assert cells[0] in (text, f"'{text}")  # a spreadsheet must not take a text for a formula
        assert float(cells[1]) == pytest.approx(x, rel=1e-11, abs=0)
        assert int(cells[2]) == n
        assert cells[3] == ""


# Names of models as people write them
# -------------------------------------------------------------------------------------------------


def test_every_competitor_has_a_title_of_its_own():
    titles = [literature.get(name).title for name in literature.names()] + [*OTHERS.values()]
    assert all(titles)
    assert len({*titles}) == len(titles)
    assert not any("_" in title for title in titles)


@pytest.mark.parametrize(
    ("name", "title"),
    [
        ("sarosi_hinged", "Sárosi, hinged"),
        ("sarosi+reynolds", "Sárosi + Reynolds"),
        ("arx", "ARX"),
        ("mapmore", "mapmore"),
        ("my_own+sarosi", "my_own+sarosi"),
        ("1e+05", "1e+05"),
        ("", ""),
    ],
)
def test_what_is_no_known_name_stays_as_it_is(name, title):
    assert title_of(name) == title


def test_a_page_has_titles_and_a_file_has_names():
    columns = (Column("model", form="model"), Column("curve"), Column("gaussian_process", "%"))
    table = Table("t", "t", columns, (("sarosi_hinged", "plane", 1.0),))
    html = to_html(table)
    assert (
        "Sárosi, hinged" in html,
        "Gaussian process <span" in html,
        "<td>plane</td>" in html,
    ) == (True, True, True)
    assert to_csv(table).startswith("model,curve,gaussian_process [%]\nsarosi_hinged,")


def test_commands_in_a_sentence_are_code_and_names_stay_text():
    template = environment().from_string("{{ sentence|code }}")
    shown = template.render(sentence="<b>: see `mapmore check`, and `a < b` or ` alone")
    assert shown == (
        "&lt;b&gt;: see <code>mapmore check</code>, and <code>a &lt; b</code> or ` alone"
    )
