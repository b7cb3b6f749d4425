"""Draft the specs of one study: interpret its columns, ask the open questions, and write a draft
for each quantity to predict.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from mapmore_cli.annexes.drafting.answers import Answers
from mapmore_cli.annexes.drafting.by_titles import known_by_titles
from mapmore_cli.annexes.drafting.checked import checked
from mapmore_cli.annexes.drafting.cleaning import cleaned
from mapmore_cli.annexes.drafting.columns import Table
from mapmore_cli.annexes.drafting.draft import Draft, Named
from mapmore_cli.annexes.drafting.experiment import Experiment, find_held
from mapmore_cli.annexes.drafting.finding import find
from mapmore_cli.annexes.drafting.held_out import LAST_SAMPLES, WHOLE
from mapmore_cli.annexes.drafting.like import with_paper
from mapmore_cli.annexes.drafting.name_groups import files_for_tests, numbered_groups
from mapmore_cli.annexes.drafting.names import offers_of
from mapmore_cli.annexes.drafting.questions import Ask, interview
from mapmore_cli.annexes.drafting.reading import read_draft, split_by, table_of
from mapmore_cli.annexes.drafting.second_log import with_second_log
from mapmore_cli.annexes.drafting.sources import started
from mapmore_cli.annexes.drafting.static_or_memory import FEWEST, with_experiment
from mapmore_cli.annexes.drafting.studies import FolderStudy
from mapmore_cli.annexes.drafting.understanding import Understood, understood
from mapmore_cli.annexes.drafting.written_columns import with_columns, with_strain
from mapmore_cli.checking.evidence import Unequal, unequal
from mapmore_cli.domain.errors import UsageError


def propose(
    study: FolderStudy,
    folder: Path,
    answers: Answers,
    second: FolderStudy | None,
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
    answers = _with_measured_strain(answers, table)
    beside: Named = {}
    if second is not None:
        columns, beside = _shared_out(answers.columns, table)
        inputs, in_second = _shared_out(answers.inputs or {}, table)
        beside |= in_second
        answers = replace(answers, columns=columns, inputs=answers.inputs and inputs)
    view = partial(understood, study, table, path=path, is_driven=second is not None)
    if ask is not None:
        answers = interview(table, study.names, view, answers, ask)
    known = view(answers)
    if answers.validate not in (None, WHOLE, LAST_SAMPLES):
        held_out = known.drive_called(answers.validate, table, "--validate")
        answers = replace(answers, validate=held_out)
    proposal = _Proposal(study, folder, table, answers, known)
    return [proposal.draft_of(target, second, beside) for target in known.targets]


def _shared_out(columns: Named, table: Table) -> tuple[Named, Named]:
    """Split the columns that a person named into columns of this table and columns of another log
    file.
    """
    here: Named = {}
    for name, column in columns.items():
        with suppress(UsageError):
            find(table, column.column, "--columns")
            here[name] = column
    return here, {name: column for name, column in columns.items() if name not in here}


def _with_measured_strain(answers: Answers, table: Table) -> Answers:
    """Return the answers. An input `strain` that no column has is replaced by the measured length
    or displacement, from which `with_strain` computes the strain.
    """
    inputs = dict(answers.inputs or {})
    strain = inputs.pop("strain", None)
    if strain is None or answers.length is None or not strain.refers_to("strain"):
        return answers
    known = known_by_titles(table)[0] | answers.columns
    measured = next((name for name in ("length", "displacement") if name in known), None)
    if measured is None or "strain" in known:
        return answers
    return replace(answers, inputs={**inputs, measured: known[measured]})


@dataclass(frozen=True)
class _Proposal:
    """A study with its columns, the answers of a person, and the interpretation of both. Paths in
    drafts start at `folder`.
    """

    study: FolderStudy
    folder: Path
    table: Table
    answers: Answers
    known: Understood

    def draft_of(self, target: str, second: FolderStudy | None, beside: Named) -> Draft:
        """Return the draft for one quantity to predict. If the files of the study lack the pressure
        and a second log (`second`) has it, this log is joined; `beside` are the columns of the
        second log that a person named.
        """
        draft = self._with_files()
        if len(self.known.targets) > 1:
            name = f"{self.study.name}-{target}"
            draft = replace(draft.with_section("name", name), of=self.study.name)
        draft = with_columns(draft, self.known, target, self.table)
        if second is not None and "pressure" not in self.known.columns:
            draft = with_second_log(draft, second, self.folder, target, beside)
        draft = self._with_experiment(draft, target)
        return replace(draft, tips=(*self._tips(draft), *draft.tips))

    def _with_files(self) -> Draft:
        """Return a draft with the files, the time between samples and the groups."""
        answers, known = self.answers, self.known
        in_names, group = [*known.conditions], known.group
        if group is not None and group not in known.columns:
            in_names.append(numbered_groups(self.study.names, group))
        draft = started(self.study, self.folder, in_names, known.remark, known.columns)
        if answers.sample_time is not None:
            draft = draft.with_data("sample_time", answers.sample_time, "s: you")
        elif answers.no_clock:
            draft = draft.without_data("sample_time")
        if group is None:
            return draft
        return draft.with_data("groups", {"of": group}, "you; each group is scored separately")

    def _with_experiment(self, draft: Draft, target: str) -> Draft:
        """Return the draft with the settings that its recordings need, and with its target, levels
        and held-out data. If `check` finds an error in this draft, a simpler draft is returned.
        """
        answers, known, folder = self.answers, self.known, self.folder
        in_names = {condition.quantity: condition.in_model_units for condition in known.conditions}
        hold, made = answers.hold, ""
        if answers.length is not None:
            draft, made = with_strain(draft, answers.length, in_names)
            target = "strain" if target == made else target
            in_names.pop(made, None)
            hold = hold._replace(name="strain") if hold is not None and hold.name == made else hold
        draft, recordings = cleaned(draft, folder, target)
        ignored = ("time", target, known.group, made, *known.apart)
        inputs = [name for name in recordings[0].columns if name not in ignored]
        draft = _with_sessions(draft, unequal(recordings, inputs, target), known.group)
        held = find_held(recordings, inputs, hold, in_names)
        numbered = [name for name in known.apart if not known.columns[name].texts]
        done = Experiment(recordings, inputs, target, held, in_names, numbered)
        whole = with_experiment(
            done, draft, answers.validate, lambda new: read_draft(new, folder, target).recordings
        )
        if answers.validate is None and (tests := files_for_tests(self.study.files)):
            held_out = {"validate": {"files": tests}}
            whole = whole.with_data("split", held_out, "the names of the files say so")
        if answers.like is not None:
            return checked(with_paper(whole, answers.like, held), (), folder)
        simple = draft.with_section("target", whole.spec["target"])
        line = [{"polynomial": {"of": inputs[:1], "order": 1}}]
        return checked(whole, (simple, simple.with_section("dictionary", line)), folder)

    def _tips(self, draft: Draft) -> Iterator[str]:
        """Yield tips on further options: for rows that are no samples, for a column whose blocks of
        equal values may be recordings, for numbers in names that may be levels, and for the time
        between samples of long recordings that have neither a clock nor levels.
        """
        answers, known = self.answers, self.known
        chosen = {*answers.columns, *(answers.inputs or {})} & {*known.inputs}
        names = [name for name in ("time", known.group, *chosen) if name in known.columns]
        used = {place for name in names for place in known.columns[name].places}
        read = {column.column for column in known.columns.values()}
        for column in self.table.values():
            if column.summaries and column.column not in read:
                yield (
                    f"rows with {', '.join(column.summaries)} in {column.called} are read as "
                    "samples, but seem to be computed from the other rows. "
                    f"`--group {column.asked_for}` leaves them out, and scores the groups of other "
                    "rows separately; or delete them in a copy of the file"
                )
            if column.blocks and column.column not in used and not answers.recordings:
                yield (
                    f"each value of {column.called} is in one block of rows; if each of the "
                    f"{column.blocks} blocks is a recording, write "
                    f"`--recordings {column.asked_for}`, so that lags stay within a recording"
                )
        if not answers.hold:
            yield from offers_of(self.study.names)
        rows = max((len(x) for column in self.table.values() for x in column.values), default=0)
        # the rows of a map have no order
        has_clock = "time" in draft.data["columns"] or self.study.layout.is_map
        keys = {"sample_time", "levels"}
        if not (has_clock or answers.no_clock) and keys.isdisjoint(draft.data) and rows >= FEWEST:
            back = next(
                (
                    column.called
                    for column in self.table.values()
                    if column.is_time and column.falls
                ),
                "",
            )
            runs = f"{back} runs backwards, so it is not used as the clock; if the model may have"
            yield (
                f"{runs} memory, sort the rows by time; otherwise write `--no-clock`"
                if back
                else "no column is a clock, so the order of the rows is not used; if the time from "
                "row to row is constant, write it, for example `--sample-time 10ms`, so that the "
                "model may have memory; otherwise write `--no-clock`"
            )


def _with_sessions(draft: Draft, apart: Unequal | None, group: str | None) -> Draft:
    """Return the draft with what follows from `apart`: two recordings that have equal inputs, but
    unequal outputs. If a person named the groups (`group`), settings for the groups are added to
    the draft. Otherwise, a note asks whether the recordings belong to different sessions. The draft
    is unchanged if there are no such recordings, or if a person named the groups and neither a gain
    nor an offset explains the difference.
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
        f"`groups: {{{line}}}`. Or do the lines above the tables give a quantity that differs? If "
        "so, write it beside each file, for example `set: {pressure: 200 kPa}`"
    )
    return draft.noted(("data", "reader"), apart.words() + how, sure=not apart.is_large)
