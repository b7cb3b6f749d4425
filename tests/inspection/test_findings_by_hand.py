"""What `check` has found: the error that ends a run, and the file in which findings are kept."""

from dataclasses import replace
from itertools import product
from types import SimpleNamespace

from mapmore_cli.checking.findings import (
    FINDINGS,
    Issue,
    as_text,
    kept,
    mark_of,
    refusal,
    sentences,
)
from mapmore_cli.domain.errors import DataError, SpecError


def test_errors_end_a_run_with_all_their_remedies():
    of_spec = Issue("error", "a", "x:1", "it is wrong", "mend it")
    of_data = replace(of_spec, id="b", cause="data")
    assert refusal([replace(of_spec, severity="warning")]) is None
    both = refusal([of_spec, of_data])
    assert type(both) is SpecError
    assert both.message == "x:1: it is wrong [a]\n  mend it\nx:1: it is wrong [b]"
    assert both.remedy.startswith("mend it; or continue in spite of this error with --no-check")
    assert type(refusal([of_data])) is DataError


def test_findings_are_kept_until_something_changes_on_which_they_depend(tmp_path):
    issue = Issue("error", "a", "x:1", "it is wrong", "mend it")
    (tmp_path / FINDINGS).write_text(as_text("mark", [issue]))
    assert kept(tmp_path) == kept(tmp_path, "mark") == (issue,)
    assert kept(tmp_path, "other") is kept(tmp_path / "nowhere") is None
    assert sentences(tmp_path) == ("it is wrong; mend it [a]",)
    assert sentences(tmp_path / "nowhere") == ()
    specs = [SimpleNamespace(resolved=text) for text in ("name: a", "name: b")]
    assert len({mark_of(spec, data) for spec, data in product(specs, ("one", "two"))}) == 4
