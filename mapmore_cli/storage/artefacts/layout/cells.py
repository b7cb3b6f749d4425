"""Codecs that the stored types have in common."""

from __future__ import annotations

from mapmore_cli.storage.artefacts.codecs import adapted, named, number, numbers, optional, text, texts

TEXT, REAL, COUNT = text(), number(float), number(int)
OPTIONAL_TEXT, OPTIONAL_REAL = optional(TEXT), optional(REAL)
TEXTS = texts()
REALS, TABLE = numbers("<f8"), numbers("<f8", ndim=2)
INTEGERS = numbers("<i8")
FLAGS = numbers("|u1", load_dtype="bool")  # not HDF5's enumeration, which MATLAB reads as text
CELL = adapted(INTEGERS, store=list, load=lambda array: tuple(array.tolist()))
SPAN = adapted(REALS, store=list, load=lambda array: tuple(array.tolist()))
LIMITS = named(SPAN)
