"""Split a text into words, and spell it in the Latin alphabet."""

from __future__ import annotations

import re
import unicodedata


def words(text: str) -> list[str]:
    """Return the words and numbers of a text, in lower case."""
    return [word.casefold() for word in re.findall(r"[^\W\d_]+|\d+", text)]


def spelt(text: str) -> str:
    """Return a text in the Latin alphabet. Accents are removed. A letter of another alphabet is
    replaced by its Unicode name (`θ1` becomes `theta1`); a Greek letter within a word by the
    beginning of its name (`Πίεση` becomes `piese`). Any other sign is replaced by its number in
    Unicode.
    """
    without_marks = "".join(
        sign for sign in unicodedata.normalize("NFKD", text) if not unicodedata.combining(sign)
    )
    return re.sub(r"[^\W\d_a-zA-Z]+", _spelt_word, without_marks)


def _spelt_word(match: re.Match[str]) -> str:
    letters: list[str] = []
    for sign in match[0]:
        letter = unicodedata.name(sign, "").rpartition(" LETTER ")[2].removeprefix("FINAL ").lower()
        name = letter.partition(" with ")[0]
        if sign == "\N{LATIN SMALL LETTER SHARP S}":
            name = "ss"
        elif not name.replace(" ", "").isalpha():
            name = f"u{ord(sign):x}"
        elif len(match[0]) > 1 and "GREEK" in unicodedata.name(sign):
            name = name[: 2 if name[:2] in ("th", "ph", "ch", "ps") else 1]
        letters.append(name.replace(" ", "_"))
    return "".join(letters)
