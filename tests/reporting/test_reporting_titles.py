"""Names of models as people write them."""

from __future__ import annotations

import pytest

from mapmore_cli.domain.scores import BASELINES, SIMPLE
from mapmore_cli.modelling import literature
from mapmore_cli.reporting.table import Column, Table, title_of, to_csv, to_html


def test_every_formula_has_a_title_of_its_own() -> None:
    titles = [literature.get(name).title for name in literature.names()]
    assert all(titles)
    assert len({*titles, *BASELINES.values(), *SIMPLE.values()}) == len(titles) + len(BASELINES) + len(SIMPLE)
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
def test_what_is_no_known_name_stays_as_it_is(name: str, title: str) -> None:
    assert title_of(name) == title


def test_a_page_has_titles_and_a_file_has_names() -> None:
    columns = (Column("model", form="model"), Column("curve"), Column("gaussian_process", "%"))
    table = Table("t", "t", columns, (("sarosi_hinged", "plane", 1.0),))
    html = to_html(table, title_of)
    assert ("Sárosi, hinged" in html, "Gaussian process <span" in html, "<td>plane</td>" in html) == (True, True, True)
    assert to_csv(table).startswith("model,curve,gaussian_process [%]\nsarosi_hinged,")
