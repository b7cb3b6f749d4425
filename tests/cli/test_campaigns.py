"""Campaigns: variants of a spec, one table, one page."""

import json
import re

import pytest
from cli_samples import edit, write_study

from mapmore_cli.study.campaign import load_campaign

pytestmark = pytest.mark.usefixtures("batch_here")

CAMPAIGN = """\
campaign: sweep
title: "How many terms <here>?"
base: bench.yaml
relative_to: polynomial_2
runs:
  - {name: one, set: {fit.max_terms: 1}}
  - {name: two, set: {fit.max_terms: 2, fuse: {z_s: 0.4}}}
  - {name: broken, set: {data.files: ["none_*.csv"]}}
"""


@pytest.fixture
def campaign(tmp_path):
    write_study(tmp_path)
    path = tmp_path / "sweep.yaml"
    path.write_text(CAMPAIGN)
    return path


def test_a_campaign_runs_its_variants_and_writes_its_page(campaign, tmp_path, mapmore):
    result = mapmore("batch", campaign, "-q", "--jobs", 1)
    assert result.exit_code == 4  # one variant has no data; the others are done
    assert "none_*.csv" in result.stderr
    page = (tmp_path / "runs" / "sweep" / "index.html").read_text()
    assert "How many terms &lt;here&gt;?" in page
    assert "broken failed" in page
    for name in ("one", "two"):
        assert f'href="../{name}/report/index.html"' in page
        assert (tmp_path / "runs" / name / "report" / "index.html").is_file()
    assert "z_s: 0.4" in (tmp_path / "runs" / "two" / "experiment.yaml").read_text()
    record = json.loads((tmp_path / "runs" / "sweep" / "campaign.json").read_text())
    assert record["runs"] == ["one", "two"]
    assert "ratio, geometric mean" in result.stdout
    table = (tmp_path / "runs" / "sweep" / "tables" / "nrmse.csv").read_text()
    rows = [line.split(",")[:2] for line in table.splitlines()[1:4]]
    assert [name for name, _ in rows] == ["one", "two", "broken"]
    assert rows[2][1] == "failed"
    assert "broken: error:" in result.stderr
    *_, one, two, broken = result.stdout.splitlines()
    for name, line in (("one", one), ("two", two)):
        assert re.fullmatch(
            rf"{name}: (alert: .*; )?(better|worse|no difference.*|.*tie): .* RMSE: mapmore \S+ N "
            r"\(\S+ %\), .* N \(\S+ %\)",
            line,
        )
    assert broken.startswith("broken: failed: error:")


def test_paths_start_at_the_campaign(campaign):
    _, entries = load_campaign(campaign)
    assert {entry.config for entry in entries} == {campaign.parent / "bench.yaml"}
    assert entries[1].overrides == ('name="two"', "fit.max_terms=2", 'fuse={"z_s": 0.4}')


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("base: bench.yaml\n", "", ["sweep.yaml:4", "no spec"]),
        (
            "{name: one, set: {fit.max_terms: 1}}",
            "{set: {fit.max_terms: 1}}",
            ["sweep.yaml:6", "name"],
        ),
        ("title:", "titel:", ["sweep.yaml:2:1", "title"]),
        ("campaign:", "name:", ["sweep.yaml:1:1", "lacks the key `campaign`"]),
        ("name: two", "name: one", ["one"]),
    ],
)
def test_wrong_campaigns(campaign, old, new, words, mapmore):
    campaign.write_text(CAMPAIGN.replace(old, new))
    assert mapmore("batch", campaign, says=words).exit_code in (2, 3)


def test_every_run_of_a_campaign_is_checked(campaign, mapmore):
    result = mapmore("check", campaign, code=4)
    assert "one: no issues" in result.stdout
    assert "two: no issues" in result.stdout
    assert "none_*.csv" in result.stdout
    document = json.loads(mapmore("check", campaign, "--json").stdout)
    assert document["campaign"] == "sweep"
    assert document["runs"]["one"] == {"issues": []}
    assert "none_*.csv" in document["runs"]["broken"]["error"]
    sound = mapmore("check", campaign, "--set", "data.files=[bench_*.csv]")
    assert (sound.exit_code, sound.stdout) == (
        0,
        "one: no issues\ntwo: no issues\nbroken: no issues\n",
    )


def test_a_campaign_is_no_experiment(campaign, mapmore):
    mapmore("run", campaign, code=3, says=["sweep.yaml:1:1", "campaign", "mapmore batch"])


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("sweep", ["campaign 'sweep'", "other.yaml"]),
        ("one.plain", ["bench.yaml as 'plain'", "other.yaml"]),
    ],
)
def test_folders_of_one_name_are_refused_at_start(name, words, campaign, mapmore):
    spec = campaign.with_name("bench.yaml")
    edit(spec, "[polynomial_2]", "[{set: {fit.max_terms: 1}, as: plain}]")
    other = campaign.with_name("other.yaml")
    other.write_text(spec.read_text().replace("name: bench", f"name: {name}"))
    campaign.write_text(CAMPAIGN[: CAMPAIGN.index("  - {name: two")])
    mapmore(
        "batch",
        campaign,
        other,
        "--runs",
        campaign.with_name("runs"),
        code=2,
        says=[f"the same name, '{name}'", *words],
    )
    assert not campaign.with_name("runs").exists()


@pytest.mark.parametrize(
    ("record", "what"),
    [
        ("run.json", "files that mapmore did not write there"),
        ("notes.txt", "files that mapmore did not write"),
    ],
)
def test_a_campaign_without_a_place_for_its_page_is_refused_at_start(
    record, what, campaign, tmp_path, mapmore
):
    place = tmp_path / "runs" / "sweep"
    place.mkdir(parents=True)
    (place / record).write_text("{}")
    mapmore("batch", campaign, code=7, says=f"holds {what}")
    assert [path.name for path in (tmp_path / "runs").iterdir()] == ["sweep"]
