"""Delimited text of plain decimal numbers, read all at once: the bytes of a block are taken as vectors, eight digits as one word.

A number here is an optional minus, at most eight digits, a point, and at most eight digits. Its digits make a whole number `m` up to 2^53,
and `k` of them stand behind the point. Both `m` and `10^k` are exact in double precision, so that their quotient is the double nearest to
the number as written (Clinger 1990), which is also what Python and NumPy read. A block that holds anything else is left to the caller.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapmore_cli.domain.arrays import Array, BoolArray

Words = NDArray[np.uint64]
"""Eight characters each, the first in the lowest byte."""

DIGITS = 8
"""Of a word: the most on one side of the point."""

LARGEST = 1 << 53
"""Up to here, every whole number is a double."""

NEWLINE, MINUS, POINT, QUOTE = b'\n-."'
PAD = b"0" * DIGITS  # so that a word may begin or end beyond the text


def plain_numbers(text: str, delimiter: str, width: int, places: tuple[int, ...]) -> Array | None:
    """The columns at `places`, (n, len(places)), of lines that all have `width` fields and plain numbers there; else None."""
    try:
        content = text.encode("ascii")
    except UnicodeEncodeError:
        return None
    if b"\r" in content:
        content = content.replace(b"\r\n", b"\n")
    if not content.endswith(b"\n"):
        content += b"\n"
    if b"\r" in content or b'"' in content or len(delimiter) != 1 or delimiter in "-.0123456789":
        return None
    return _columns(PAD + content + PAD, ord(delimiter), width, places)


def _columns(padded: bytes, delimiter: int, width: int, places: tuple[int, ...]) -> Array | None:
    codes = np.frombuffer(padded, dtype=np.uint8)
    words: Words = np.ndarray(len(padded) - DIGITS + 1, dtype="<u8", buffer=padded, strides=(1,))  # one begins at every byte
    marks = np.flatnonzero((codes == delimiter) | (codes == NEWLINE) | (codes == POINT))
    is_point = codes[marks] == POINT
    last = np.flatnonzero(~is_point)  # of each field, the mark that ends it
    if len(last) % width:
        return None
    ends = marks[last]
    if (codes[ends].reshape(-1, width) != np.array([delimiter] * (width - 1) + [NEWLINE], dtype=np.uint8)).any():
        return None
    starts = np.concatenate([[DIGITS], ends[:-1] + 1])
    has_point = is_point[last - 1] & (last > 0)
    points = np.where(has_point, marks[last - 1], ends)
    values = np.empty((len(ends) // width, len(places)), order="F")
    for j, place in enumerate(places):
        column = slice(place, None, width)
        numbers = _numbers(codes, words, starts[column], points[column], ends[column])
        if numbers is None:
            return None
        values[:, j] = numbers
    return values


_ASCII_ZEROS = np.uint64(int.from_bytes(PAD, "little"))
_LAST = np.array([2**64 - 256 ** (DIGITS - n) for n in range(DIGITS + 1)], dtype=np.uint64)
"""Masks of the last n bytes of a word."""
_MOVED = np.array([256 ** (DIGITS - n) % 2**64 for n in range(DIGITS + 1)], dtype=np.uint64)
"""Factors that move the first n bytes of a word to its end, and zeros before them."""
_TENS = 10 ** np.arange(DIGITS + 1, dtype=np.uint64)


def _numbers(codes: NDArray[np.uint8], words: Words, starts: Any, points: Any, ends: Any) -> Array | None:
    """The numbers whose text begins at `starts`, has its point at `points`, and ends before `ends`, (n,) each."""
    negative: BoolArray = codes[starts] == MINUS
    before = points - starts - negative
    behind = np.maximum(ends - points - 1, 0)
    if before.max() > DIGITS or behind.max() > DIGITS or (before + behind).min() < 1:
        return None
    whole = (words[points - DIGITS] ^ _ASCII_ZEROS) & _LAST[before]
    part = (words[points + 1] ^ _ASCII_ZEROS) * _MOVED[behind]
    if _beyond_digits(whole) or _beyond_digits(part):
        return None
    digits = _decimal(whole) * _TENS[behind] + _decimal(part)
    if digits.max() > LARGEST:
        return None
    values: Array = digits / _TENS[behind].astype(np.float64)
    return np.negative(values, where=negative, out=values)


def _beyond_digits(words: Words) -> bool:
    """Whether a byte is more than nine."""
    return bool((((words + np.uint64(0x7676767676767676)) | words) & np.uint64(0x8080808080808080)).any())


def _decimal(words: Words) -> Words:
    """The number whose decimal digits are the bytes of a word: neighbours are joined to pairs, pairs to fours, and fours to eight."""
    pairs = words * np.uint64(10) + (words >> np.uint64(8))  # right in every second byte
    odd, even = np.uint64(0x000F424000000064), np.uint64(0x0000271000000001)  # 10^6 and 10^2, 10^4 and 1
    every_fourth = np.uint64(0x000000FF000000FF)
    joined: Words = ((pairs & every_fourth) * odd + ((pairs >> np.uint64(16)) & every_fourth) * even) >> np.uint64(32)
    return joined
