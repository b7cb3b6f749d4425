"""What a rule found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Severity = Literal["error", "warning", "hint"]
"""An error makes the study wrong or impossible, a warning probably wrong; a hint says what could be better."""

Cause = Literal["spec", "data"]
"""What has to be mended."""

ORDER: tuple[Severity, ...] = ("error", "warning", "hint")


@dataclass(frozen=True)
class Issue:
    """One thing that a user should look at.

    Attributes
    ----------
    severity, id
        How bad it is, and the rule's name for it, which stays the same from release to release.
    place
        `file:line:column` of the spec, or the recording.
    message, remedy
        What is wrong, and what to do.
    cause
        What has to be mended; of an error, it decides the exit code.
    """

    severity: Severity
    id: str
    place: str
    message: str
    remedy: str
    cause: Cause = "spec"
