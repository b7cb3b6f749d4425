"""Every kind of alert and every warning that the code can print has a row in docs/messages.md, and
every row of the page belongs to a text of the code. The rows of rules are compared with the rules
in `inspection/test_lint_rules.py`.

A warning is the text of a call of `warn`, or a text of a function from which such a call has it.
`FROM` says for each call which functions these are, so that a call with texts from elsewhere fails
the test.
"""

import ast
import re
from pathlib import Path

import mapmore_cli
from mapmore_cli.reporting.alerts import ALERTS

PACKAGE = Path(mapmore_cli.__file__).parent
PAGE = (PACKAGE.parent / "docs" / "messages.md").read_text("utf-8")

NOTES_OF_MODELS = (
    "modelling/frols/offsets.py: far_from_zero constant_alone",
    "modelling/pieces/remarks.py: beyond_remarks",
    "modelling/pieces/backbone_choice.py: choose_backbone",
    "modelling/pieces/residual_share.py: with_trusted_residual",
    "modelling/shape/violations.py: with_shape",
    "modelling/memory/shaped.py: _warnings_of_zero_gain",
    "modelling/memory/model.py: outliers_fed_back",
    "modelling/validation/residuals.py: explained_by_inputs",
)
IN_FILES = (
    "ingestion/dataset.py: build_dataset _mended _losses",
    "ingestion/clock.py: _at_gaps",
    "ingestion/reading.py: _against_the_file",
    "storage/tables/gate.py: _with_padding_told _without_cut_rows",
    "storage/tables/members.py: tables",
    "storage/readers/lvm.py: read_lvm",
    "storage/readers/xlsx.py: _chosen_sheets _hidden_in_words",
)
INTERVALS = ("modelling/validation/intervals.py: interval_limits SAME_RECORDINGS",)
IN_ALERTS = (
    "reporting/alerts.py: unconfirmed_sentence",
    "modelling/validation/residuals.py: alarms _of_scores _bare",
    "pipeline/scoring.py: _scored",
    "domain/scores.py: STRUCTURE_SEEN",
)

KINDS = "reporting/alerts.py: _of_residuals _of_held_out _of_competitors"
"""Texts of the alerts that are rows of the page by their kind."""

PLUGINS = ("domain/plugins.py: _installed _leave_out",)
FROM = {
    "ingestion/dataset.py build_dataset": IN_FILES,
    "pipeline/stages.py fit": NOTES_OF_MODELS,
    "pipeline/stages.py fuse": (*NOTES_OF_MODELS, *INTERVALS),
    "pipeline/scoring.py _warn_of_fits": (
        "pipeline/scoring.py: _diverged",
        "reporting/fit_tables.py: rival_minima",
    ),
    "pipeline/report.py write_pages": ("pipeline/report.py: faults_of",),
    "pipeline/report.py drawn_figure": ("pipeline/report.py: faults_of",),
    "annexes/search/stage.py run_search": (
        "annexes/search/searching.py: search _uneven _plain_note",
        "annexes/search/further.py: longer_note outdone_note",
    ),
    "pipeline/predict.py predicted_lines": INTERVALS,
    "pipeline/foreign.py foreign_lines": IN_FILES,
    "storage/artefacts/__init__.py read": ("storage/artefacts/__init__.py: _record",),
    "cli/pipeline.py _bring_up_to_date": IN_ALERTS,
    "domain/plugins.py _installed": PLUGINS,
    "domain/plugins.py _leave_out": PLUGINS,
    "api/estimator.py _target": (),  # in the words of scikit-learn
    # these say again what other calls have said
    "pipeline/runner.py tell": (),
    "pipeline/runner.py bring": (),
    "pipeline/scoring.py _left_out": (),
    "pipeline/notebooks.py export": (),
    "cli/pipeline.py warn": (),
    "annexes/campaigns/commands.py _tell": (),
    "annexes/campaigns/commands.py _results": (),
    "annexes/campaigns/commands.py tell": (),
    "api/runs.py load_model": (),
    "api/runs.py run": (),
    "api/sections.py fit": (),
}
PARTS = (
    "is in ... according to the file",
    "write unit: ..., or set scale to the factor",
    "correct the formula between the dollar signs, or remove",
    "guess of the spec is",
    "guesses of the spec are",
    "the first of ... gaps",
    "chooses the short one",
)
"""Texts that are parts of other warnings, or of errors."""

SENTENCE = 4
"""Words of a text that is a message, and not part of one."""


def tree_of(path):
    return ast.parse((PACKAGE / path).read_text("utf-8"))


def parts_of(tree):
    """The functions and constants of a file, by name."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            yield node.name, node
        elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            yield node.targets[0].id, node.value


def template(node):
    """A text of the code, with `…` where values are filled in; empty for anything else."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    parts = node.values if isinstance(node, ast.JoinedStr) else ()
    return "".join(part.value if isinstance(part, ast.Constant) else "…" for part in parts)


def texts_in(node):
    """Yield the messages in a part of the code, without docstrings and texts of errors."""
    if isinstance(node, ast.Raise) or (
        isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    ):
        return
    text = template(node)
    if len(re.findall(r"\w{2,}", text)) >= SENTENCE:
        yield text
    elif not text:
        for child in ast.iter_child_nodes(node):
            yield from texts_in(child)


def warnings_of_the_code():
    """Yield every text of a warning, with the place at which it stands."""
    for path in sorted(PACKAGE.rglob("*.py")):
        file = path.relative_to(PACKAGE).as_posix()
        for name, function in parts_of(tree_of(file)):
            if not isinstance(function, ast.FunctionDef):
                continue
            calls = (
                node.args[0]
                for node in ast.walk(function)
                if isinstance(node, ast.Call)
                and getattr(node.func, "attr", getattr(node.func, "id", "")) == "warn"
            )
            for text in map(template, calls):
                if re.search(r"\w", text):
                    yield f"{file} {name}", text
                else:
                    for source in FROM[f"{file} {name}"]:
                        yield from texts_from(source)


def texts_from(source):
    """Yield the texts of the functions that an entry of `FROM` names."""
    file, _, names = source.partition(": ")
    parts = dict(parts_of(tree_of(file)))
    for name in names.split():
        for text in texts_in(parts[name]):
            yield f"{file} {name}", text


def rows_of(heading):
    """The first two cells of each row of the tables below a heading of the page."""
    section = PAGE.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    return re.findall(r"^\| ([^|]+) \| ([^|]+) \|", section, re.MULTILINE)


def patterns(*of):
    """The messages in the first cells of the sections whose headings begin like this; in the second
    cells of the table of alerts.
    """
    for heading in re.findall(r"^## (.*)$", PAGE, re.MULTILINE):
        if heading.startswith(of):
            for first, second in rows_of(heading):
                sentence = second if re.fullmatch(r"`[a-z ]+`", first) else first
                yield from re.findall(r"`([^`]+)`", sentence)


def is_of(pattern, text):
    """Return True if what a pattern says between its `...` stands in a text, in this order."""
    parts = (part.strip() for part in pattern.split("..."))
    said = (re.escape(part) for part in parts if re.search(r"\w", part))
    return re.search(".*".join(said), text.replace("`", "")) is not None


def test_every_kind_of_alert_has_a_row():
    rows = rows_of("Alerts: why the score may mislead")
    kinds = [first.strip("`") for first, _ in rows if re.fullmatch(r"`[a-z ]+`", first)]
    assert kinds == list(ALERTS)


def test_every_warning_has_a_row_and_every_row_is_a_warning():
    texts = {text for _, text in warnings_of_the_code()}
    texts |= {text for _, text in texts_from(KINDS)}
    shown = [*patterns("Alerts", "Warnings")]
    assert len(texts) > 70
    assert [text for text in texts if not any(is_of(one, text) for one in (*shown, *PARTS))] == []
    assert [one for one in shown if not any(is_of(one, text) for text in texts)] == []


def test_errors_that_the_page_explains_are_texts_of_the_code():
    """Not every error has a row, because an error says itself what to do."""
    texts = "\n".join(
        template(node).replace("\n", " ")
        for path in PACKAGE.rglob("*.py")
        for node in ast.walk(tree_of(path))
        if isinstance(node, ast.JoinedStr | ast.Constant)
    )
    shown = [*patterns("Errors")]
    assert len(shown) > 25
    assert [one for one in shown if not is_of(one, texts)] == []
