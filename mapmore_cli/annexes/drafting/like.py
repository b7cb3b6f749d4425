"""Provide the settings of the papers for `init --like`: segments, dictionary, number of terms, and
transition zones.
"""

from __future__ import annotations

from mapmore_cli.annexes.drafting.draft import Draft
from mapmore_cli.annexes.drafting.experiment import Held
from mapmore_cli.domain.errors import UsageError


def with_paper(draft: Draft, paper: str, held: Held | None) -> Draft:
    """Return the draft with the settings of a paper. `paper` is `m1` or `m2`, as in
    docs/references.md. The settings are those of the paper's static study, in which one quantity
    was swept at levels of another.

    The paper M1 (section IV) uses three segments; it does not state the number of terms and the
    extrapolation. The paper M2 (sections 4.4 and 5.1) uses the method of M1 with four segments and
    one term, and extrapolates with the last piece.

    Raises UsageError if no quantity was held constant.
    """
    if held is None:
        raise UsageError(
            f"--like {paper}: these settings need a quantity that was held "
            "constant; none was found",
            "name the quantity, for example `--hold pressure`",
        )
    terms: dict[str, float] = {"max_terms": 1}
    count, reference = 3, "M1, section IV"
    if paper == "m2":
        terms |= {"tolerance": 1e-4}
        count, reference = 4, "M2, sections 4.4 and 5.1"
    draft = draft.with_section(
        "segment",
        {held.swept: {"method": "even", "count": count}},
        f"{reference}: {count} segments of equal width",
    )
    draft = draft.with_section(
        "dictionary",
        [{"polynomial": {"of": [held.swept], "order": 4}}],
        "the candidates: powers up to the fourth",
    )
    draft = draft.with_section(
        "fit",
        {"scaling": "unit_square", **terms},
        "inputs scaled to 0..1; `max_terms` limits the terms of each segment",
    )
    return draft.with_section(
        "fuse",
        {"transition": "linear", "z_s": 0.25, "hold": "none", "extrapolation": "continue"},
        "weights fall linearly in zones of a quarter of each segment (eq 9-12); `hold: none`: "
        "inputs are not clamped; `continue`: the last piece also applies beyond the data",
    )
