"""Implement `mapmore init`: draft specs for a file or a folder, with a remark about everything that
is left out.

The meaning of a column follows from its title, its unit and the answers of the person. It is never
guessed from values.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from mapmore_cli.annexes.drafting.answers import Answers
from mapmore_cli.annexes.drafting.by_titles import known_by_titles
from mapmore_cli.annexes.drafting.channels import command_for_one_table
from mapmore_cli.annexes.drafting.checked import checked
from mapmore_cli.annexes.drafting.cleaning import cleaned
from mapmore_cli.annexes.drafting.columns import Table, find
from mapmore_cli.annexes.drafting.draft import Draft, Named
from mapmore_cli.annexes.drafting.experiment import Experiment, find_held
from mapmore_cli.annexes.drafting.held_out import LAST_SAMPLES, WHOLE
from mapmore_cli.annexes.drafting.like import with_paper
from mapmore_cli.annexes.drafting.names import numbered_groups, offers_of, tests_of
from mapmore_cli.annexes.drafting.questions import Ask, interview
from mapmore_cli.annexes.drafting.reading import described, read_draft, split_by, table_of
from mapmore_cli.annexes.drafting.second_log import second_of, with_second_log
from mapmore_cli.annexes.drafting.sources import started
from mapmore_cli.annexes.drafting.static_or_memory import FEWEST, with_experiment
from mapmore_cli.annexes.drafting.studies import Study, find_studies
from mapmore_cli.annexes.drafting.understanding import Understood, understood
from mapmore_cli.annexes.drafting.written_columns import with_columns, with_strain
from mapmore_cli.checking.evidence import Unequal, unequal
from mapmore_cli.domain.errors import DataError, SpecError, UsageError, Warn
from mapmore_cli.storage.readers import READERS

NOTHING_SAID = Answers()


@dataclass(frozen=True)
class Start:
    """The drafts, the draft with the most files first, and remarks about files and columns that no
    draft uses.
    """

    drafts: tuple[Draft, ...]
    remarks: tuple[str, ...]


def propose(
    study: Study,
    folder: Path,
    answers: Answers,
    second: Study | None,
    ask: Ask | None,
    path: str,
) -> list[Draft]:
    """Return the specs of a study, one for each output, with paths relative to `folder`. The
    structures of their models are left to the search in a run.

    Raises
    ------
    UsageError
        If neither titles nor `answers` say what to predict, and nobody can be asked; or if an
        answer names something that does not exist.
    DataError
        If the recordings cannot be read, or if `check` finds an error in them.
    """
    table = split_by(table_of(study, folder), answers.recordings)
    columns, beside = _shared_out(answers.columns, table)
    answers = replace(answers, columns=columns, inputs=_measured_strain(answers, table))
    if second is not None and answers.inputs is not None:
        inputs, in_second = _shared_out(answers.inputs, table)
        answers, beside = replace(answers, inputs=inputs), beside | in_second

    def view(answers: Answers) -> Understood:
        return understood(study, table, answers, path, is_driven=second is not None)

    if ask is not None:
        answers = interview(table, study.names, view, answers, ask)
    known = view(answers)
    if answers.validate not in (None, WHOLE, LAST_SAMPLES):
        held_out = known.drive_called(answers.validate, table, "--validate")
        answers = replace(answers, validate=held_out)
    in_names, group = [*known.conditions], known.group
    if group is not None and group not in known.columns:
        in_names.append(numbered_groups(study.names, group))
    drafts = []
    for target in known.targets:
        draft = started(study, folder, in_names, known.remark, known.columns)
        if answers.sample_time is not None:
            draft = draft.with_data("sample_time", answers.sample_time, "s: you")
        elif answers.no_clock:
            draft = draft.without_data("sample_time")
        if group is not None:
            draft = draft.with_data("groups", {"of": group}, "you; each group is scored separately")
        if len(known.targets) > 1:
            name = f"{study.name}-{target}"
            draft = replace(draft.with_section("name", name), of=study.name)
        draft = with_columns(draft, known, target, table)
        if second is not None and "pressure" not in known.columns:
            draft = with_second_log(draft, second, folder, target, beside)
        drafts.append(_with_experiment(draft, study, folder, known, target, answers))
    tips = (*_tips(table, known, answers), *(offers_of(study.names) if not answers.hold else ()))
    return [
        replace(draft, tips=(*tips, *_tip_on_clock(draft, table, answers), *draft.tips))
        for draft in drafts
    ]


def _tip_on_clock(draft: Draft, table: Table, answers: Answers) -> Iterator[str]:
    """Yield a tip on the time between samples, for long recordings that have neither a clock nor
    levels.
    """
    has_clock = "time" in draft.data["columns"] or "sample_time" in draft.data
    rows = max((len(x) for one in table.values() for x in one.values), default=0)
    if not has_clock and not answers.no_clock and "levels" not in draft.data and rows >= FEWEST:
        yield (
            "no column is a clock, so the order of the rows is not used; if the time from row to "
            "row is constant, write it, for example `--sample-time 10ms`, so that the model may "
            "have memory; otherwise write `--no-clock`"
        )


def _tips(table: Table, known: Understood, answers: Answers) -> Iterator[str]:
    """Yield tips on further options: for a column whose blocks of equal values may be recordings,
    and for rows that are no samples.
    """
    named = {**answers.columns, **(answers.inputs or {})}
    used = {known.columns[name].column for name in known.inputs if name in named}
    for name in ("time", known.group):
        if name in known.columns:
            used |= known.columns[name].places
    for one in table.values():
        if one.summaries and one.column not in {
            known.columns[name].column for name in known.columns
        }:
            yield (
                f"rows with {', '.join(one.summaries)} in {one.called} are read as samples, but "
                f"seem to be computed from the other rows. `--group {one.asked_for}` leaves them "
                "out, and scores the groups of other rows separately; or delete them in a copy of "
                "the file"
            )
        if one.blocks and one.column not in used and not answers.recordings:
            yield (
                f"each value of {one.called} is in one block of rows; if each of the {one.blocks} "
                f"blocks is a recording, write `--recordings {one.asked_for}`, so that lags stay "
                "within a recording"
            )


def _measured_strain(answers: Answers, table: Table) -> Named | None:
    """Return the inputs. An input `strain` that no column has is replaced by the measured length or
    displacement, from which `with_strain` computes the strain.
    """
    inputs, known = answers.inputs, known_by_titles(table)[0] | answers.columns
    measured = next((name for name in ("length", "displacement") if name in known), None)
    if inputs is None or answers.length is None or measured is None or "strain" in known:
        return inputs
    strain = inputs.get("strain")
    if strain is None or not strain.refers_to("strain"):
        return inputs
    others = {name: column for name, column in inputs.items() if name != "strain"}
    return {**others, measured: known[measured]}


def _shared_out(columns: Named, table: Table) -> tuple[Named, Named]:
    """Split the columns that a person named into columns of this table and columns of another log
    file.
    """
    beside = dict(columns)
    for name, column in columns.items():
        with suppress(UsageError):
            find(table, column.column, "--columns")
            del beside[name]
    return {name: columns[name] for name in columns if name not in beside}, beside


def _with_experiment(
    draft: Draft, study: Study, folder: Path, known: Understood, target: str, answers: Answers
) -> Draft:
    """Return the draft with the settings that its recordings need, and with its target, levels and
    held-out data.
    """
    in_names = {one.quantity: one.in_model_units for one in known.conditions}
    hold, made = answers.hold, ""
    if answers.length is not None:
        draft, made = with_strain(draft, answers.length, in_names)
        target = "strain" if target == made else target
        in_names.pop(made, None)
        hold = hold._replace(name="strain") if hold is not None and hold.name == made else hold
    draft, dataset = cleaned(draft, folder, target)
    ignored = ("time", target, known.group, made, *known.apart)
    used = dict.fromkeys([*dataset.recordings[0].columns, *in_names])
    inputs = [name for name in used if name not in ignored]
    draft = _with_sessions(draft, unequal(dataset.recordings, inputs, target), known.group)
    held = find_held(dataset.recordings, inputs, hold, in_names)
    numbered = [name for name in known.apart if not known.columns[name].texts]
    done = Experiment(dataset.recordings, inputs, target, held, in_names, numbered)
    whole = with_experiment(
        done, draft, answers.validate, lambda draft: read_draft(draft, folder, target).recordings
    )
    if answers.validate is None and (tests := tests_of(study.files)):
        held_out = {"validate": {"files": tests}}
        whole = whole.with_data("split", held_out, "the names of the files say so")
    if answers.like is not None:
        return checked(with_paper(whole, answers.like, held), (), folder)
    simple = draft.with_section("target", whole.spec["target"])
    line = [{"polynomial": {"of": inputs[:1], "order": 1}}]
    return checked(whole, (simple, simple.with_section("dictionary", line)), folder)


def _with_sessions(draft: Draft, apart: Unequal | None, group: str | None) -> Draft:
    """Return the draft. If two recordings have equal inputs but unequal outputs (`apart`), settings
    for the groups that a person named are added to it; without such groups, a remark is added.
    """
    if apart is None or (group is not None and not apart.effects):
        return draft
    effects = dict.fromkeys(apart.effects, True)
    if group is not None:
        why = "a group that is held out is predicted with the mean of all groups"
        return draft.with_data("groups", {"of": group, **effects}, f"{apart.words()}; {why}")
    line = ", ".join(["of: session", *(f"{effect}: true" for effect in effects)])
    how = (
        "; do they belong to different sessions? If so, use `--group session`, which writes "
        f"`groups: {{{line}}}`"
    )
    return draft.noted(("data", "reader"), apart.words() + how, sure=not apart.is_large)


def start(
    path: Path,
    folder: Path,
    name: str | None = None,
    single: bool = False,
    answers: Answers = NOTHING_SAID,
    ask: Ask | None = None,
    tell: Warn = lambda _: None,
) -> Start:
    """Draft specs for every study under `path`, or for the largest one only, with relative paths
    from `folder`.

    If somebody can be asked (`ask`), the questions are about the largest study. If there are
    several layouts, `tell` is first called with a line for each of them.

    Raises
    ------
    DataError
        If nothing usable is found; the message gives the reason for every file.
    UsageError
        If the quantity to predict is unknown for every study.
    """
    studies, remarks = find_studies(path)
    labels = _names_apart(studies)
    if len(studies) > 1:
        tell(f"{path} has {len(studies)} layouts:")
        for study, label in zip(studies, labels, strict=True):
            tell(f"  {label}: {described(study, folder)}")
    seconds = [second_of(study, studies) for study in studies]
    is_single = single or ask is not None
    drafts: list[Draft] = []
    refusal: UsageError | None = None
    for study, second, label in zip(studies, seconds, labels, strict=True):
        if study in seconds:
            continue
        why = "another study" if drafts and is_single else ""
        if study is not studies[0] and answers.has_places:
            first = studies[0].files[0].name
            why = f"another layout; the numbers of columns that you give belong to {first}"
        if why:
            remarks.append(f"{label} ({study}): {why}; call `mapmore init` with its files alone")
            continue
        is_only = is_single or len(studies) == 1
        called = replace(
            study, name=label if name is None else name if is_only else f"{name}-{label}"
        )
        try:
            found = propose(called, folder, answers, second, ask, str(path))
            remarks += dict.fromkeys(one.bad_files for one in found if one.bad_files)
            drafts += found
        except (UsageError, DataError, SpecError) as fault:
            if isinstance(fault, UsageError):
                if ask is not None:
                    raise
                refusal = refusal or fault
            remarks.append(f"{label} ({study}): {fault.message.splitlines()[0]}")
    if drafts:
        return Start(tuple(drafts), tuple(remarks))
    if (command := command_for_one_table(path)) is not None:
        raise DataError(
            f"{path}: each file holds one channel, and a recording needs all of them in one table",
            f"make a table of them, for example with: {command}\n  "
            "then call `mapmore init` with this table",
        )
    endings = sorted({suffix for reader in READERS.values() for suffix in reader.suffixes})
    reasons = "\n  ".join(remarks) or f"give files with one of the endings {' '.join(endings)}"
    raise refusal or DataError(f"{path}: no usable recording was found", reasons)


def _names_apart(studies: Sequence[Study]) -> list[str]:
    """Return distinct names of studies: a number is appended to a name that repeats."""
    labels = [study.name or "study" for study in studies]
    return [
        name if labels.count(name) == 1 else f"{name}-{labels[: place + 1].count(name)}"
        for place, name in enumerate(labels)
    ]
