"""What machines that run tests read of runs."""

import math
import xml.etree.ElementTree as ET

from hypothesis import given
from hypothesis import strategies as st

from mapmore_cli.domain.scores import Limit
from mapmore_cli.reporting.ci import RunReport, to_junit, to_summary
from mapmore_cli.reporting.table import Column, Table

KEPT, MISSED = (Limit("nrmse", "mapmore", "validate", value, 0.05) for value in (0.03, 0.07))
RUNS = [
    RunReport("good", 1.5, None, (KEPT,), ("a warning",)),
    RunReport("missed", 2.0, None, (MISSED, Limit("r2", "mapmore", "validate", math.nan, 0.9))),
    RunReport("broken", failure="none_*.csv: no such file\n  name files that exist"),
]


def test_every_run_and_every_limit_is_a_case():
    suite = ET.fromstring(to_junit(RUNS)).find("testsuite")
    assert {key: suite.get(key) for key in ("tests", "failures", "errors", "time")} == {
        "tests": "6", "failures": "2", "errors": "1", "time": "3.500",
    }  # fmt: skip
    cases = {(case.get("classname"), case.get("name")): case for case in suite}
    assert list(cases[("mapmore.good", "require nrmse")]) == []
    failure = cases[("mapmore.missed", "require nrmse")].find("failure")
    assert (
        failure.get("message") == "nrmse of mapmore on the validate rows is 0.07; the limit is 0.05"
    )
    # no number keeps no limit
    assert cases[("mapmore.missed", "require r2")].find("failure") is not None
    error = cases[("mapmore.broken", "run")].find("error")
    assert error.get("message") == "none_*.csv: no such file"
    assert cases[("mapmore.good", "run")].findtext("system-err") == "a warning"


@given(st.text(), st.text())
def test_any_name_and_message_gives_well_formed_xml(name, text):
    root = ET.fromstring(to_junit([RunReport(name, failure=f"x{text}", warnings=(text,))]))
    assert len(list(root.iter("testcase"))) == 1


def test_the_summary_says_what_went_wrong_first():
    text = to_summary(
        RUNS, [Table("scores", "Scores", (Column("run"), Column("NRMSE")), (("good", 0.03),))]
    )
    lines = text.splitlines()
    assert lines[0] == "## mapmore: 1 of 3 runs in order"
    assert lines[2].startswith("- **missed**: nrmse of mapmore")
    assert "- **broken**: none\\_\\*.csv: no such file name files that exist" in lines
    assert "| good | 0.03000 |" in lines
