"""What is known of a run that has ended."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from mapmore_cli.checking import findings
from mapmore_cli.pipeline import jobs, runs_rows
from mapmore_cli.pipeline.jobs import Job
from mapmore_cli.pipeline.runner import Options
from mapmore_cli.reporting import alerts


@pytest.mark.parametrize("known", [None, (), ("seen",)])
@pytest.mark.parametrize("searched", [True, False])
@pytest.mark.parametrize("until_now", ["up-to-date", "done"])
def test_results_are_read_for_alerts_unless_the_page_knows_them(
    monkeypatch, known, searched, until_now
):
    names = ("dataset", "model", "validation", "search")
    files = SimpleNamespace(folder="r", **{name: lambda name=name: name for name in names})
    monkeypatch.setattr(jobs, "RunFiles", lambda _folder: files)
    monkeypatch.setattr(runs_rows, "known_alerts", lambda _folder: known)
    monkeypatch.setattr(findings, "sentences", lambda _folder: "findings")
    monkeypatch.setattr(alerts, "alerts_of", lambda *results: results)
    stages = {"ingest": "up-to-date", **({"search": until_now} if searched else {})}
    outcome = SimpleNamespace(run_dir=Path("r"), stages={**stages, "report": until_now})
    is_known = until_now == "up-to-date" and known is not None
    for questions in ((), ("u",)):
        whole = ("dataset", "model", "validation", questions, "findings")
        whole += ("search" if searched else None,)
        alerts_now = known if is_known and not questions else whole
        assert jobs._alerts(outcome, questions) == alerts_now


def test_a_job_for_another_machine_has_whole_paths_and_waits():
    for campaign in (None, Path("c.yaml")):
        job = Job(Path("s.yaml"), Path("runs"), ("a=1",), Options(campaign=campaign), "fit")
        there = job.elsewhere()
        assert (there.config, there.runs) == (Path("s.yaml").absolute(), Path("runs").absolute())
        assert (there.overrides, there.until) == (("a=1",), "fit")
        assert there.options.patient
        assert there.options.campaign == (campaign and campaign.absolute())
