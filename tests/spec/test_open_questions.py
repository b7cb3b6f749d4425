"""Open questions of a spec: comments that begin with CHECK, each with the key that it is about."""

from __future__ import annotations

from mapmore_cli.spec.loader import confirmed, questions_in

SPEC = """\
# look first at those marked CHECK
data:
  columns:
    time: {column: 0}  # CHECK: it never decreases
    # CHECK: a force, or a position?
    # Values do not tell
    force: {column: 1}  # nothing open
  files: ["a # CHECK b"]
target: static  # CHECK: tried
"""


def test_questions_are_found_with_their_keys_and_go_when_they_are_confirmed() -> None:
    assert questions_in(SPEC) == ("time: it never decreases", "force: a force, or a position? Values do not tell", "target: tried")
    assert questions_in(confirmed(SPEC)) == ()
    assert "# it never decreases" in confirmed(SPEC)
