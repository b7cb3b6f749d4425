"""Implement `mapmore init`: draft specs for a file or a folder, with a remark about everything that
is left out.

The meaning of a column follows from its title, its unit and the answers of the person. It is never
guessed from values.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from mapmore_cli.annexes.drafting.answers import Answers
from mapmore_cli.annexes.drafting.channels import command_for_one_table
from mapmore_cli.annexes.drafting.draft import Draft
from mapmore_cli.annexes.drafting.proposal import propose
from mapmore_cli.annexes.drafting.questions import Ask
from mapmore_cli.annexes.drafting.reading import described
from mapmore_cli.annexes.drafting.second_log import second_of
from mapmore_cli.annexes.drafting.studies import FolderStudy, find_studies
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
    found_studies, remarks = find_studies(path)
    studies = _with_own_names(found_studies)
    if len(studies) > 1:
        tell(f"{path} has {len(studies)} layouts:")
        for study in studies:
            tell(f"  {study.name}: {described(study, folder)}")
    seconds = [second_of(study, studies) for study in studies]
    is_single = single or ask is not None
    drafts: list[Draft] = []
    refusal: UsageError | None = None
    for study, second in zip(studies, seconds, strict=True):
        if study in seconds:
            continue
        label = f"{study.name} ({study})"
        why = "another study" if drafts and is_single else ""
        if study is not studies[0] and answers.has_places:
            first = studies[0].files[0].name
            why = f"another layout; the numbers of columns that you give belong to {first}"
        if why:
            remarks.append(f"{label}: {why}; call `mapmore init` with its files alone")
            continue
        if name is not None:
            is_only = is_single or len(studies) == 1
            study = replace(study, name=name if is_only else f"{name}-{study.name}")
        try:
            proposed = propose(study, folder, answers, second, ask, str(path))
        except (UsageError, DataError, SpecError) as fault:
            if isinstance(fault, UsageError):
                if ask is not None:
                    raise
                refusal = refusal or fault
            remedy = None if isinstance(fault, UsageError) else fault.remedy
            parts = filter(None, [label, fault.message.splitlines()[0], remedy])
            remarks.append(": ".join(parts))
        else:
            remarks += dict.fromkeys(
                proposal.bad_files for proposal in proposed if proposal.bad_files
            )
            drafts += proposed
    if not drafts:
        raise _refuse_all(path, refusal, remarks)
    return Start(tuple(drafts), tuple(remarks))


def _with_own_names(studies: Sequence[FolderStudy]) -> list[FolderStudy]:
    """Return the studies with distinct names: a number is appended to a name that repeats."""
    names = [study.name or "study" for study in studies]
    labels = [
        name if names.count(name) == 1 else f"{name}-{names[: place + 1].count(name)}"
        for place, name in enumerate(names)
    ]
    return [replace(study, name=label) for study, label in zip(studies, labels, strict=True)]


def _refuse_all(
    path: Path, refusal: UsageError | None, remarks: Sequence[str]
) -> DataError | UsageError:
    """Return the error for a path for which no draft could be made. If each file holds one channel,
    the message contains the command that makes one table of the files. Otherwise, the `refusal` of
    a study is returned, if there is one, or an error that lists the `remarks` about all files.
    """
    if (command := command_for_one_table(path)) is not None:
        return DataError(
            f"{path}: each file holds one channel, and a recording needs all of them in one table",
            f"make a table of them, for example with: {command}\n  "
            "then call `mapmore init` with this table",
        )
    if refusal is not None:
        return refusal
    endings = sorted({suffix for reader in READERS.values() for suffix in reader.suffixes})
    reasons = "\n  ".join(remarks) or f"give files with one of the endings {' '.join(endings)}"
    return DataError(f"{path}: no usable recording was found", reasons)
