"""What can be wrong with a term: its text, or its value on the data."""

from __future__ import annotations

from mapmore_cli.domain.errors import DataError


class ExpressionError(ValueError):
    """Text that is no expression; `position` is the 0-based offset of the first character that does not fit."""

    def __init__(self, message: str, position: int = 0) -> None:
        super().__init__(message)
        self.message = message
        self.position = position


class NotFinite(DataError, ValueError):
    """A term without a finite value on a row of the data: `term` is its text, `row` the 0-based row."""

    def __init__(self, term: str, row: int, inputs: str) -> None:
        super().__init__(
            f"the term `{term}` is not finite in row {row} ({inputs})",
            "leave the term out of the dictionary, or keep only samples on which it is defined",
        )
        self.term = term
        self.row = row
