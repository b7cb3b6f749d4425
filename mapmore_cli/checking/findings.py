"""Define the findings of `mapmore check`, and store them in the run folder. Every command that
brings a run up to date reports the findings about this run.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic import TypeAdapter

from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.storage.atomic import content_of

if TYPE_CHECKING:
    from mapmore_cli.study.loader import LoadedSpec

Severity = Literal["error", "warning", "hint"]
"""An error means that the study is wrong or impossible, and a warning that it is probably wrong. A
hint says what could be better.
"""

Cause = Literal["spec", "data"]
"""What must be corrected to remove a finding."""


@dataclass(frozen=True)
class Issue:
    """A finding that a user should look at: `message` says what is wrong, and `remedy` what to do.

    `id` is the name of the finding, which stays the same in all releases. `place` is a
    `file:line:column` of the spec, or the recording. `cause` is what must be corrected; it decides
    the exit code of an error.
    """

    severity: Severity
    id: str
    place: str
    message: str
    remedy: str
    cause: Cause = "spec"

    @property
    def text(self) -> str:
        """The finding as text: place, message and id, with the remedy on a line of its own."""
        return f"{self.place}: {self.message} [{self.id}]\n  {self.remedy}"

    @property
    def sentence(self) -> str:
        """The finding as a sentence: message, remedy and id. The place is left out, because a
        stored line number may be wrong: a run stays up to date if only the lines of its spec are
        moved.
        """
        return f"{self.message}; {self.remedy} [{self.id}]"


def is_for_the_spec(errors: Iterable[Issue]) -> bool:
    """Return True if at least one of the errors is in the spec. The user must then correct the spec
    first; afterwards, the data are checked again.
    """
    return any(issue.cause == "spec" for issue in errors)


def refusal(issues: Iterable[Issue]) -> SpecError | DataError | None:
    """Return the exception that ends a run because of its issues. Its message contains every issue
    that is an error, with place and remedy. Return None if no issue is an error.
    """
    errors = [issue for issue in issues if issue.severity == "error"]
    if not errors:
        return None
    *before, last = errors
    message = "\n".join(
        [*(issue.text for issue in before), last.text.removesuffix(f"\n  {last.remedy}")]
    )
    kind = SpecError if is_for_the_spec(errors) else DataError
    return kind(
        message,
        f"{last.remedy}; or continue in spite of this error with --no-check "
        "(`check=False` in Python)",
    )


FINDINGS = "check.json"
"""Name of the file in the run folder that holds the findings."""

REVISION = 6
"""Revision of the rules. It is raised when a rule changes, so that findings of older rules are not
used.
"""


@dataclass(frozen=True)
class Kept:
    """Contents of the findings file: the findings, and a hash (`mark`) of everything on which they
    depend.
    """

    mark: str
    issues: tuple[Issue, ...]


_KEPT = TypeAdapter(Kept)


def mark_of(loaded: LoadedSpec, ingested: str) -> str:
    """Return a hash of everything on which findings depend: the rules, the spec, and the
    fingerprint of the ingested data.
    """
    return hashlib.sha256(f"{REVISION} {ingested} {loaded.resolved}".encode()).hexdigest()


def kept(run_dir: Path, mark: str | None = None) -> tuple[Issue, ...] | None:
    """Return the stored findings of a run. Return None if there are none, or if they were stored
    with another `mark`, because something on which they depend has changed.
    """
    with suppress(OSError, ValueError):
        stored = _KEPT.validate_json(content_of(run_dir / FINDINGS))
        if mark in (None, stored.mark):
            return stored.issues
    return None


def as_text(mark: str, issues: Sequence[Issue]) -> str:
    """Return the findings as the text that is stored in the run folder."""
    return _KEPT.dump_json(Kept(mark, tuple(issues)), indent=1).decode() + "\n"


def sentences(run_dir: Path) -> tuple[str, ...]:
    """Return the stored findings of a run as sentences."""
    return tuple(issue.sentence for issue in kept(run_dir) or ())
