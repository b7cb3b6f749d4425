"""Escape text from users and files, so that it does no harm in terminals, CSV, C, Python, TeX and
XML.

Every function that writes such a text to a file uses these functions. They do not look for
dangerous words. They escape every character outside a small alphabet, in which no character can end
a comment, a string or a line.
"""

from __future__ import annotations

import re
import string
import unicodedata
from itertools import accumulate

_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069]")
"""Control characters (except tabs and line feeds), which a terminal obeys instead of showing them,
and marks that change the direction of writing.
"""

_BROKEN = re.compile(rf"{_CONTROL.pattern}|[\t\n\ud800-\udfff]")

_FORMULA = ("=", "+", "-", "@")
"""First characters of cells that a spreadsheet takes for a formula and computes."""

PLAIN = frozenset(string.ascii_letters + string.digits + " .,:;=+-_()[]<>/^|%'")
"""Characters that may stand in comments unchanged: no double quotes, backslashes, asterisks,
question marks, number signs, dollars or line ends.
"""


def printable(text: str) -> str:
    r"""Return the text with its control characters escaped. For example, `\x1b` replaces the escape
    character, with which commands to a terminal begin.
    """
    return _CONTROL.sub(lambda match: match[0].encode("unicode_escape").decode("ascii"), text)


def is_one_line(text: str) -> bool:
    """Return True if the text is one line without control characters and surrogates."""
    return not _BROKEN.search(text)


def csv_cell(text: str) -> str:
    """Return the text as a cell of a CSV table, on one line. An apostrophe is put before a text
    that a spreadsheet would compute as a formula.
    """
    text = _BROKEN.sub(" ", text)
    return f"'{text}" if text.lstrip().startswith(_FORMULA) else text


def plain(text: str) -> str:
    """Return the text on one line, with only characters of the alphabet `PLAIN`. Any other
    character is replaced by its number in braces, for example `{2A}`.
    """
    return "".join(char if char in PLAIN else f"{{{ord(char):X}}}" for char in text)


def tex_comment(*lines: str) -> list[str]:
    """Return TeX comments, one for each line."""
    return [f"% {plain(line)}" for line in lines]


def xml_text(text: str, kept: str = "") -> str:
    """Replace the characters of a text that are not allowed in XML, not even as escape sequences.
    Only printable characters and the characters in `kept` remain; any other character is replaced
    by its hexadecimal code in braces, such as `{1B}`.
    """
    return text.translate(
        {
            ord(char): f"{{{ord(char):X}}}"
            for char in set(text)
            if not char.isprintable() and char not in kept
        }
    )


def _greek(letter: str) -> str:
    name = unicodedata.name(letter).rpartition(" ")[2].replace("LAMDA", "LAMBDA")
    return rf"\ensuremath{{\{name.capitalize() if letter.isupper() else name.lower()}}}"


_TEX_SYMBOLS = {
    **{"−": "-", "±": r"\pm", "×": r"\times", "·": r"\cdot", "⋅": r"\cdot", "°": r"^\circ"},
    **{"µ": r"\mu", "≤": r"\leq", "≥": r"\geq", "≈": r"\approx", "√": r"\surd", "∞": r"\infty"},
}
_TEX_NAMES = {
    "\\": "backslash",
    "^": "asciicircum",
    "~": "asciitilde",
    "<": "less",
    ">": "greater",
    "|": "bar",
}
_TEX = str.maketrans(
    {char: rf"\ensuremath{{{symbol}}}" for char, symbol in _TEX_SYMBOLS.items()}
    | {char: rf"\text{name}{{}}" for char, name in _TEX_NAMES.items()}
    | {"–": "--", "²": r"\textsuperscript{2}", "³": r"\textsuperscript{3}"}
    | {letter: _greek(letter) for letter in "αβγδεζηθικλμνξπρςστυφχψωΓΔΘΛΞΠΣΥΦΨΩ"}
    | {c: f"\\{c}" for c in "&%$#_{}"}
    # LaTeX would take brackets or a star at the start of a row for an argument of `\\`.
    | {c: f"{{{c}}}" for c in "[]*"}
)


def tex_text(text: str) -> str:
    """Return LaTeX source on one line that prints the text unchanged. TeX commands in the text are
    printed, not executed.
    """
    return _printed(text).translate(_TEX)


def _printed(text: str) -> str:
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


_FORMULA_COMMANDS = (
    "alpha beta gamma delta epsilon varepsilon zeta eta theta vartheta iota kappa lambda mu "
    "nu xi pi rho sigma tau upsilon phi varphi chi "
    "psi omega Gamma Delta Theta Lambda Xi Pi Sigma Upsilon Phi Psi Omega mathrm mathit "
    "mathbf mathsf frac sqrt dot ddot hat bar tilde vec "
    "overline cdot times circ pm leq geq approx infty partial nabla sum int left right degree "
    "prime langle rangle quad"
)
_LETTERS = r"[A-Za-z0-9 .,:;=+\-()\[\]<>/|'!*]"
_IN_FORMULA = re.compile(
    rf"(?:{_LETTERS}|[{{}}_]|\^(?!\^)|\\[,;: "
    rf"]|\\(?:{_FORMULA_COMMANDS.replace(' ', '|')})(?![A-Za-z]))*"
)
_FORMULAS = re.compile(r"(?<!\\)\$((?:[^$\\]|\\.)*)\$")


def tex_label(text: str) -> str:
    """Return LaTeX source for a label with formulas between dollars. Formulas may contain symbols
    and a few commands; any other formula is printed as text.
    """
    text, tex, end = _printed(text), "", 0
    for match in _FORMULAS.finditer(text):
        if _IN_FORMULA.fullmatch(match[1]) and _is_balanced(match[1]):
            tex += f"{text[end : match.start()].translate(_TEX)}${match[1]}$"
            end = match.end()
    return tex + text[end:].translate(_TEX)


def _is_balanced(formula: str) -> bool:
    """Return True if every brace that opens is closed, in the right order."""
    depths = [0, *accumulate((char == "{") - (char == "}") for char in formula)]
    return min(depths) == depths[-1] == 0
