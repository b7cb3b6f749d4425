"""`make paper`: every study is in it, its numbers are those of the published tables, and its page needs nothing else."""

from __future__ import annotations

import csv
import importlib
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from page_tables import DOCS

from mapmore_cli.spec.campaign import load_campaign
from mapmore_cli.spec.loader import load

CONFIGS = DOCS.parent / "configs"
PUBLISHED = DOCS.parent / "datasets" / "published"


@pytest.fixture(scope="module")
def paper_page() -> Iterator[ModuleType]:
    sys.path.insert(0, str(DOCS))
    yield importlib.import_module("paper_page")
    sys.path.remove(str(DOCS))


@pytest.fixture(scope="module")
def result() -> Iterator[ModuleType]:
    sys.path.insert(0, str(DOCS))
    yield importlib.import_module("paper.result")
    sys.path.remove(str(DOCS))


def rows(name: str) -> list[dict[str, str]]:
    with (PUBLISHED / name).open(encoding="utf-8", newline="") as lines:
        return list(csv.DictReader(lines))


def test_every_shipped_study_is_run(paper_page: ModuleType) -> None:
    studies = {path.resolve() for path in CONFIGS.glob("*/[!_]*.yaml") if path.parent.name != "campaigns"}
    campaigns = (*paper_page.SIMULATED, *paper_page.MEASURED)
    run = {entry.config.resolve() for name in campaigns for entry in load_campaign(CONFIGS / "campaigns" / f"{name}.yaml")[1]}
    # those of the coiled muscles in general are run on every record of the campaign, under the names of these
    assert {path.relative_to(CONFIGS).as_posix() for path in studies - run} == set()


@pytest.mark.parametrize("file", ["m1_results.csv", "m2_results.csv"])
def test_the_specs_show_the_numbers_of_the_published_tables(file: str) -> None:
    for row in rows(file):
        spec = load(CONFIGS / file[:2] / f"{row['study']}.yaml").spec.report.published
        assert spec is not None
        given = {"rmse": spec.rmse, "nrmse": spec.nrmse} if row["relation"] == "=" else {"rmse": spec.rmse_at_least}
        scale = 0.01 if row["unit"] == "%" else 1.0
        assert given[row["quantity"]][row["model"]] == pytest.approx(scale * float(row["printed"]))


def test_every_result_that_may_differ_has_a_reason(paper_page: ModuleType, result: ModuleType) -> None:
    assert set(result.reasons()) <= set(paper_page.RESULTS)
    assert set(paper_page.RESULTS) - set(result.reasons()) == {"p-table-1", "p-table-2"}  # the printed parameters, and an input


def test_a_verdict_counts_what_differs(result: ModuleType) -> None:
    parts = [("size", True), ("size", False), ("order", False), ("R²", True)]
    found = result.Result("m1-static", "M1", "", "", (), parts)
    assert (found.verdict, found.agreed) == ("differs: size (1 of 2), order", 2)
    assert "free strain" in found.reason
    same = result.Result("m1-static", "M1", "", "", (), parts[:1])
    assert (same.verdict, same.reason) == ("agrees", "")
    assert result.same_size(2.0, 1.0)
    assert not result.same_size(2.01, 1.0)
    assert not result.same_size(-1.0, 1.0)


def test_the_page_is_one_file(paper_page: ModuleType, tmp_path: Path, mapmore: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("dmsp-20-88-static", "peano-static"):
        done = mapmore("validate", CONFIGS / "m2" / f"{name}.yaml", "--runs", tmp_path, "-q")
        assert done.exit_code == 0, done.stderr
    monkeypatch.setattr(paper_page, "RESULTS", {name: paper_page.RESULTS[name] for name in ("m1-static", "m2-static")})
    failed: dict[str, str] = {}
    found = list(paper_page.results(tmp_path, failed))
    assert [one.id for one in found] == ["m2-static"]
    assert list(failed) == ["m1-static"]  # whose runs are not there
    part = paper_page.Part("a campaign", (), (), ("coiled/coiled_steps.yaml",))
    assert 'href="#coiled/coiled_steps.yaml"' in paper_page.page([], [part], {}, "")
    html = paper_page.page(found, [], failed, "none here")
    assert "m1-static failed" in html
    outside = [link for link in re.findall(r'(?:href|src)="([^"]*)"', html) if not re.match(r"#|[\w.-]+/report/index\.html$", link)]
    assert outside == []
    assert "<script" not in html
    assert "Left out: none here" in html
    table = [row for row in rows("m2_results.csv") if row["figure"] in ("9", "10")]
    for row in table:
        assert re.search(rf"{row['study']}</th><td>{row['model']}</td><td>{float(row['printed']):g}</td>", html)
    assert "polynomial: {of: [strain], order: 4}" in html  # of the spec
