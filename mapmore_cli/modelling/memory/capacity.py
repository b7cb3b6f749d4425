"""How much memory a dictionary would need, and how much there is."""

from __future__ import annotations

import os

from mapmore_cli.domain.errors import DataError

WORD = 8
"""Bytes of a number."""

SHARE = 0.5
"""Of the installed memory, what one fit may take: other programs need some as well."""

ASSUMED = 4_000_000_000
"""Bytes of memory where the system does not say."""


def dictionary_bytes(samples: int, candidates: int) -> int:
    """Bytes of a whole dictionary, (n, M)."""
    return WORD * samples * candidates


def products_bytes(candidates: int) -> int:
    """Bytes of what selection needs of a dictionary that is built block by block: three matrices (M+1, M+1)."""
    return 3 * WORD * (candidates + 1) ** 2


def usable_memory() -> int:
    """Bytes that one fit may take."""
    try:
        installed = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        installed = ASSUMED
    return int(SHARE * installed)


def fits_whole(samples: int, candidates: int) -> bool:
    """Whether the whole dictionary may be in memory at once; else it is built block by block."""
    return dictionary_bytes(samples, candidates) <= usable_memory()


def refuse_beyond_memory(candidates: int) -> None:
    """Raise DataError where so many candidates are too many even block by block, saying what they would need and what there is."""
    needed, room = products_bytes(candidates), usable_memory()
    if needed > room:
        raise DataError(
            f"a dictionary of {candidates} candidates needs {_size(needed)} of memory for their products alone; {_size(room)} may be used",
            "lower the order of the products, use fewer states, or restrict the products by `with`",
        )


def _size(count: float) -> str:
    return f"{count / 1e9:.3g} GB" if count >= 1e8 else f"{count / 1e6:.3g} MB"
