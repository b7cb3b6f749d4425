"""What runs, what does not, and why; what a failing stage leaves."""

import errno
import json
import os
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from fake_study import contents, fake_stages, make_data, study

from mapmore_cli.domain.errors import DataError, FitError, WriteError
from mapmore_cli.fitting.stage import Need
from mapmore_cli.pipeline import runner, staleness
from mapmore_cli.pipeline.runner import Options, bring_up_to_date, explain
from mapmore_cli.pipeline.staleness import _from
from mapmore_cli.storage.ownership import contents_of
from mapmore_cli.storage.run_folder import run_lock
from mapmore_cli.storage.run_record import Origin, load_origin, written_files

ALL = ["ingest", "fit", "fuse", "report"]


@pytest.fixture
def folder(tmp_path):
    make_data(tmp_path)
    return tmp_path


def run(loaded, stages=None, until="report", **options):
    return bring_up_to_date(
        loaded, loaded.folder / "runs", until, stages=stages or fake_stages(), **options
    )


def reasons(loaded, stages=None, until="report", **options):
    return explain(loaded, loaded.folder / "runs", until, stages=stages or fake_stages(), **options)


@pytest.mark.parametrize(
    ("path", "told"),
    [
        ("/work/a/spec.yaml", "../../spec.yaml"),
        ("/work/spec.yaml", "../../../spec.yaml"),
        ("/work/a/runs/one/s.yaml", "s.yaml"),
        ("/home/somebody/spec.yaml", "spec.yaml"),
    ],
)
def test_no_path_leads_through_the_root_folder(path, told):
    assert _from(Path("/work/a/runs/one"), Path(path)) == told


def assert_settled(folder):
    assert run(study(folder)).reasons == {}


def record(folder):
    return json.loads((folder / "runs" / "demo" / "run.json").read_text())


def test_a_run_that_is_up_to_date_may_be_written_by_another_process(folder):
    """Nothing is written, so that no lock is needed."""
    run(study(folder))
    with run_lock(folder / "runs" / "demo"):
        assert_settled(folder)
        with pytest.raises(WriteError, match="another process"):
            run(study(folder), options=Options(force=True))


def test_first_run_and_second_run(folder):
    told = []
    ran = []
    outcome = run(
        study(folder), fake_stages(runs=ran), on_stage=lambda stage, why: told.append((stage, why))
    )
    assert outcome.name == "demo"
    assert outcome.run_dir == folder / "runs" / "demo"
    assert outcome.stages == dict.fromkeys(ALL, "done")
    assert outcome.reasons == dict.fromkeys(ALL, "first time")
    assert told == [(stage, "first time") for stage in ALL]
    before = {
        path: path.stat().st_mtime_ns for path in outcome.run_dir.rglob("*") if path.name != ".lock"
    }
    assert "experiment.yaml" in written_files(outcome.run_dir)
    again = run(study(folder), fake_stages(runs=ran))
    assert again.stages == dict.fromkeys(ALL, "up-to-date")
    assert again.reasons == {}
    assert ran == ALL
    assert {
        path: path.stat().st_mtime_ns for path in outcome.run_dir.rglob("*") if path.name != ".lock"
    } == before


def test_only_the_stages_asked_for_run(folder):
    assert run(study(folder), until="fit").stages == {"ingest": "done", "fit": "done"}
    assert run(study(folder)).stages == {
        "ingest": "up-to-date",
        "fit": "up-to-date",
        "fuse": "done",
        "report": "done",
    }


DATA = study(Path()).spec.data.model_dump(mode="json", by_alias=True)
AFTER_INGEST = ["follows from ingest", "follows from fit", "follows from fuse"]
AFTER_FIT = AFTER_INGEST[1:]
MORE_TERMS = {"dictionary": [{"terms": ["strain", "strain^2"]}], "fit": {"max_terms": 2}}

SETTINGS = [
    ({"fuse": {"z_s": 0.3}}, [None, None, "fuse.z_s: 0.25 -> 0.3", "follows from fuse"]),
    (
        {"data": {**DATA, "levels": {"of": "pressure", "at": [80.0, 150.0]}}},
        ["data.levels.at: [80.0, 250.0] -> [80.0, 150.0]", *AFTER_INGEST],
    ),
    (
        MORE_TERMS,
        [
            None,
            'dictionary[0].terms: ["strain"] -> ["strain", "strain^2"]; fit.max_terms: 1 -> 2',
            *AFTER_FIT,
        ],
    ),
]


def test_reason_of_a_revision(folder):
    run(study(folder))
    why = reasons(study(folder), fake_stages(revisions={"fit": 2}))
    assert why == list(zip(ALL, [None, "stage revision 1 -> 2", *AFTER_FIT], strict=True))


PAGE_MISSING = "output missing: report/index.html; output missing: report/tables/scores.csv"
SOURCE, RENAMED = Path("data/a.csv"), Path("data/c.csv")
RUN = Path("runs/demo")
FILES = [
    (
        lambda folder: (folder / SOURCE).write_text("e,F\n0,1\n"),
        ["source changed: data/a.csv", *AFTER_INGEST],
    ),
    (
        lambda folder: (folder / SOURCE).rename(folder / RENAMED),
        ["source removed: data/a.csv; source added: data/c.csv", *AFTER_INGEST],
    ),
    (
        lambda folder: (folder / RUN / "model.h5").unlink(),
        [None, None, "output missing: model.h5", None],
    ),
    (lambda folder: shutil.rmtree(folder / RUN / "report"), [None, None, None, PAGE_MISSING]),
    (
        lambda folder: (folder / RUN / "report" / "index.html").write_text(""),
        [None, None, None, "output changed: report/index.html"],
    ),
]


@pytest.mark.parametrize(("change", "expected"), [*SETTINGS, *FILES])
def test_what_explain_says_is_what_happens(change, expected, folder):
    """A change of the files, or sections of the spec in place of others."""
    run(study(folder))
    if callable(change):
        change(folder)
    changed = study(folder, **({} if callable(change) else change))
    told = dict(zip(ALL, expected, strict=True))
    assert dict(reasons(changed)) == told
    ran = []
    outcome = run(changed, fake_stages(runs=ran))
    assert outcome.reasons == {stage: why for stage, why in told.items() if why}
    assert ran == list(outcome.reasons)
    bring_up_to_date(changed, folder / "fresh", stages=fake_stages())
    assert contents(outcome.run_dir) == contents(folder / "fresh" / "demo")
    assert run(changed).reasons == {}


def test_explain_writes_nothing(folder):
    assert reasons(study(folder), until="fuse") == [(stage, "first time") for stage in ALL[:3]]
    assert not (folder / "runs").exists()


def spoilt(path, old, new, shift=0):
    """Replace a text of the same length; the time of the file moves by `shift`, in ns."""
    before = path.stat()
    path.write_text(path.read_text().replace(old, new))
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns + shift))


def test_content_is_read_again_only_when_needed(folder):
    rehash = Options(rehash=True)
    run_dir = run(study(folder)).run_dir
    spoilt(folder / SOURCE, "a", "z")  # as `cp -p` does: its size and its time are as they were
    assert reasons(study(folder))[0] == ("ingest", "source changed: data/a.csv")
    assert run(study(folder)).stages == dict.fromkeys(ALL, "done")
    assert_settled(folder)
    spoilt(run_dir / "model.h5", "fused", "FUSED")
    assert reasons(study(folder), options=rehash)[2] == ("fuse", "output changed: model.h5")


AN_HOUR, IN_TEN_YEARS = 3_600_000_000_000, 315_000_000_000_000_000


def shifted(path, nanoseconds):
    state = path.stat()
    os.utime(path, ns=(state.st_atime_ns + nanoseconds, state.st_mtime_ns + nanoseconds))


def test_a_source_written_after_the_clock_was_set_back_is_another(folder):
    run(study(folder))
    spoilt(folder / SOURCE, "a", "z", -AN_HOUR)
    assert run(study(folder)).reasons["ingest"] == "source changed: data/a.csv"
    # results that are newer than it, made with a later clock, included
    assert_settled(folder)


@pytest.mark.parametrize("when", ["start of ingest", "half of ingest.h5"])
def test_a_source_that_changes_while_it_is_read_is_read_again(when, folder):
    def rewritten(step):
        if step == when:
            (folder / SOURCE).write_text("e,F\n0,1\n1,2\n")

    run(study(folder), fake_stages(hook=rewritten))
    assert run(study(folder)).reasons["ingest"] == "source changed: data/a.csv"
    assert "1,2" in (folder / "runs" / "demo" / "ingest.h5").read_text()
    assert_settled(folder)


def test_the_same_content_with_another_time_is_the_same(folder):
    run_dir = run(study(folder)).run_dir
    for shift in (-AN_HOUR, IN_TEN_YEARS):
        shifted(folder / SOURCE, shift)
        assert_settled(folder)
        known = record(folder)["stages"]["ingest"]["inputs"]["data/a.csv"]["mtime_ns"]
        assert known == (folder / SOURCE).stat().st_mtime_ns
    for path in run_dir.rglob("*"):
        shifted(path, IN_TEN_YEARS)
    assert_settled(folder)


def test_results_from_the_future_are_made_anew_where_the_study_changed(folder):
    run_dir = run(study(folder)).run_dir
    for path in run_dir.rglob("*"):
        shifted(path, IN_TEN_YEARS)
    (folder / SOURCE).write_text("e,F\n0,1\n")
    assert run(study(folder)).reasons["ingest"] == "source changed: data/a.csv"
    spoilt(run_dir / "model.h5", "fused", "FUSED", IN_TEN_YEARS)
    assert run(study(folder)).reasons["fuse"] == "output changed: model.h5"
    assert_settled(folder)


def test_force(folder):
    run(study(folder))
    assert run(study(folder), until="fit", options=Options(force=True)).reasons == {
        "ingest": "forced",
        "fit": "forced",
    }
    assert_settled(folder)  # the same numbers came out


def test_record(folder):
    run(study(folder))
    document = record(folder)
    assert document["name"] == "demo"
    assert list(document["stages"]) == ALL
    ingest, fit = document["stages"]["ingest"], document["stages"]["fit"]
    assert list(ingest["inputs"]) == ["data/a.csv", "data/b.csv"]
    assert list(fit["outputs"]) == ["fit.h5", "terms.csv"]
    assert set(fit["tools"]) == {"mapmore", "numpy", "scipy", "h5py", "python"}
    assert fit["before"] == ingest["fingerprint"]
    assert fit["slice"]["fit"]["max_terms"] == 1
    text = json.dumps(document)
    assert str(folder) not in text
    assert not re.search(rf'"(/|{re.escape(str(Path.home()))})', text)


def test_resolved_spec_is_written_and_kept_up(folder):
    first = study(folder, muscle={"name": "A"})
    path = run(first, until="fuse").run_dir / "experiment.yaml"
    assert path.read_text() == first.resolved
    second = study(folder, muscle={"name": "B"})
    assert run(second, until="fuse").reasons == {}
    assert path.read_text() == second.resolved


def test_a_page_that_shows_another_command_is_made_again(folder):
    run(study(folder))
    changed = replace(study(folder), overrides=("fit.max_terms=1",))
    why = {"report": "report.command: ../../study.yaml -> ../../study.yaml fit.max_terms=1"}
    assert {stage: reason for stage, reason in reasons(changed) if reason} == why
    assert run(changed).reasons == why


@pytest.fixture
def searched(folder, monkeypatch):
    """A study whose structure is searched, and its stages."""
    for module in (runner, staleness):
        monkeypatch.setattr(module, "as_found", lambda *_: study(folder))
    ingest, fit, *_ = fake_stages()
    segment, search = replace(fit, name="segment"), replace(fit, name="search")
    search = replace(
        search,
        outputs=("search.json",),
        run=lambda _part, workspace: (workspace.out / "search.json").touch(),
    )
    return study(folder, model={"type": "auto"}, dictionary=[]), (ingest, search, segment)


def test_a_structure_found_in_other_data_is_not_used(folder, searched):
    """Found by fuzzing: the stages after the search were planned with it."""
    loaded, stages = searched
    run_dir = run(loaded, stages, "segment").run_dir

    def planned():
        plans = staleness.plan_stages(
            stages, "segment", loaded, run_dir, {}, rehash=False, force=False
        )
        return [plan.stage.name for plan in plans]

    assert planned() == ["ingest", "search", "segment"]
    (folder / "data" / "a.csv").write_text("e,F\n0,other\n")
    assert planned() == ["ingest", "search"]


@pytest.mark.parametrize(
    ("until", "is_edited", "moved"),
    [
        ("segment", False, {"found.yaml", "search.json"}),
        ("segment", True, {"search.json"}),
        ("search", False, set()),
        ("search", True, set()),
    ],
)
def test_a_search_goes_with_its_model_and_stays_if_it_was_made_alone(
    folder, searched, monkeypatch, until, is_edited, moved
):
    loaded, (ingest, search, segment) = searched
    run_dir = run(loaded, (ingest, search, segment), until).run_dir
    if is_edited:
        (run_dir / "found.yaml").write_text("edited")
    monkeypatch.setattr(runner, "as_found", lambda loaded, _run_dir: loaded)
    run(study(folder), (ingest, segment), "segment")
    assert {path.name for path in folder.glob("runs/.trash/*/demo/*")} == moved
    left = {path.name for path in run_dir.iterdir()}
    assert {"found.yaml", "search.json"} & left == {"found.yaml", "search.json"} - moved


def test_no_file_of_a_search_is_moved_while_the_command_reads_one_of_them(
    folder, searched, monkeypatch
):
    loaded, (ingest, search, segment) = searched
    run_dir = run(loaded, (ingest, search, segment), "segment").run_dir
    monkeypatch.setattr(runner, "as_found", lambda loaded, _run_dir: loaded)
    monkeypatch.setattr(runner, "is_read", lambda path: path.name == "found.yaml")
    run(study(folder), (ingest, segment), "segment")
    assert (run_dir / "search.json").is_file()
    assert not (folder / "runs" / ".trash").exists()


def test_a_run_stops_at_errors_and_at_a_lock_unless_asked_otherwise():
    assert (
        Options(force=False, rehash=False, check=True, campaign=None, patient=False)
        == runner.AS_USUAL
    )


def test_a_pipeline_has_a_search_after_ingest_only_if_it_is_asked_for():
    names = ["ingest", "segment", "fit", "fuse", "validate", "report"]
    assert [stage.name for stage in staleness.pipeline()] == names
    names.insert(1, "search")
    assert [stage.name for stage in staleness.pipeline(searched=True)] == names


def test_the_copy_of_a_spec_repeats_its_run_and_no_other(folder):
    run_dir = run(replace(study(folder), overrides=("a=1",))).run_dir
    copied = "runs/demo/experiment.yaml"
    for _ in range(2):
        run(replace(study(folder), file=copied, overrides=("b=2",)))
        assert load_origin(run_dir) == Origin("../../study.yaml", settings=("a=1", "b=2"))
    (folder / "study.yaml").touch()
    run(study(folder, name="other"))
    with pytest.raises(WriteError, match=r"contains the run 'other' of \.\./\.\./study\.yaml"):
        run(replace(study(folder, name="other"), file=copied))


def test_a_spec_that_was_written_before_an_interruption_is_the_runs_own(folder):
    run_dir = run(study(folder)).run_dir
    document = record(folder)
    document["files"]["experiment.yaml"] |= {"mtime_ns": 1, "sha256": "0" * 64}
    (run_dir / "run.json").write_text(json.dumps(document))
    assert_settled(folder)
    assert contents_of(run_dir).others == ()


def test_the_spec_of_a_run_that_is_needed_is_kept_up(folder, monkeypatch):
    """The muscle changes no stage of the other run."""
    ingest, *others = fake_stages()
    needing = replace(
        ingest, needs=lambda spec: [Need("other.yaml")] if spec.name == "demo" else []
    )
    for muscle in ({"name": "A"}, {"name": "B"}):
        other = study(folder, name="other", muscle=muscle)
        monkeypatch.setattr(staleness, "load", lambda _path, other=other: other)
        run(study(folder), (needing, *others))
        assert (folder / "runs" / "other" / "experiment.yaml").read_text() == other.resolved


def test_a_run_that_is_needed_is_repeated_if_one_of_its_stages_is_out_of_date(folder, monkeypatch):
    ingest, fit, *others = fake_stages()
    needing = replace(
        ingest, needs=lambda spec: [Need("other.yaml")] if spec.name == "demo" else []
    )
    monkeypatch.setattr(staleness, "load", lambda _path: study(folder, name="other"))
    for revised in (fit, replace(fit, revision=fit.revision + 1)):
        run(study(folder), (needing, revised, *others))
        stages = json.loads((folder / "runs" / "other" / "run.json").read_text())["stages"]
        assert stages["fit"]["revision"] == revised.revision


@pytest.mark.parametrize(
    "fault",
    [
        FitError("no", "do"),
        KeyboardInterrupt(),
        ValueError("bug"),
        OSError(errno.EACCES, "no", "/elsewhere"),
    ],
)
@pytest.mark.parametrize("step", ["start of ingest", "half of fit.h5", "half of index.html"])
def test_fault_in_a_stage_leaves_results_as_they_were(fault, step, folder):
    run_dir = run(study(folder)).run_dir
    before = contents(run_dir)

    def fail(at):
        if at == step:
            raise fault

    failing = step.split()[-1].split(".")[0].replace("index", "report")
    with pytest.raises(type(fault)):
        run(study(folder), fake_stages(fail, revisions={failing: 2}))
    assert contents(run_dir) == before
    assert sorted(path.name for path in run_dir.iterdir() if path.name.startswith(".")) in (
        [],
        [".lock"],
    )
    assert_settled(folder)


def test_full_disk_in_a_stage(folder):
    def fail(at):
        if at == "half of fit.h5":
            raise OSError(errno.ENOSPC, "full")

    with pytest.raises(WriteError, match="demo: cannot be written") as caught:
        run(study(folder), fake_stages(fail))
    assert caught.value.exit_code == 7
    assert set(contents(folder / "runs" / "demo")) == {"ingest.h5"}


def test_unreadable_source_is_a_data_error(folder):
    (folder / "data" / "c.csv").symlink_to(folder / "nowhere")
    with pytest.raises(DataError, match=r"data/c\.csv: cannot be read"):
        run(study(folder))


def test_new_output_of_a_stage_is_missed(folder):
    run(study(folder))
    stages = fake_stages()
    more = replace(stages[2], outputs=("model.h5", "model.csv"))
    assert reasons(study(folder), (*stages[:2], more, stages[3]))[2] == (
        "fuse",
        "output missing: model.csv",
    )


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "null",
        '{"stages": 3}',
        '{"stages": {}}',
        '{"format_version": "1.0", "stages": {"fit": {}}}',
        "\x00",
        "[" * 100_000,
    ],
)
def test_damaged_record_counts_as_absent(text, folder):
    run_dir = run(study(folder)).run_dir
    (run_dir / "run.json").write_text(text)
    warnings = []
    assert run(study(folder), warn=warnings.append).reasons == dict.fromkeys(ALL, "first time")
    assert len(warnings) == 1
    assert "run.json" in warnings[0]
    assert_settled(folder)


@pytest.mark.parametrize("name", ["a" * 5000, "sub/" + "é" * 200, "a\0b"])
def test_a_record_of_files_that_cannot_be_is_damaged(name, folder):
    run_dir = run(study(folder)).run_dir
    document = record(folder)
    document["stages"]["fit"]["outputs"][name] = document["stages"]["fit"]["outputs"]["fit.h5"]
    (run_dir / "run.json").write_text(json.dumps(document | {"name": name}))
    warnings = []
    assert len(reasons(study(folder), warn=warnings.append)) == len(ALL)
    assert "is damaged" in warnings[0]
    assert "run.json" in contents_of(run_dir).others


def test_edited_record_is_noticed(folder):
    run_dir = run(study(folder)).run_dir
    document = record(folder)
    document["stages"]["fit"]["fingerprint"] = "0" * 64
    (run_dir / "run.json").write_text(json.dumps(document))
    assert [stage for stage, why in reasons(study(folder)) if why] == ["fit"]


def test_record_of_a_newer_format_is_refused(folder):
    path = run(study(folder)).run_dir / "run.json"
    path.write_text(path.read_text().replace('"format_version": "1.2"', '"format_version": "2.0"'))
    with pytest.raises(DataError, match=r"run\.json.*newer"):
        run(study(folder))
