"""Write the tables of docs/baselines.md from runs, which are brought up to date first: `python
docs/baseline_tables.py RUNS [TABLE ...]`.

The measured recordings must be there (docs/data.md), and scikit-learn (extra `baselines`).
"""

from __future__ import annotations

from pathlib import Path

from pages import CONFIGS, run, scores, write_page

from mapmore_cli.domain.scores import OWN, REPEATABILITY
from mapmore_cli.modelling.learners import LEARNERS
from mapmore_cli.modelling.simple import SIMPLE
from mapmore_cli.reporting.table import Cell, Table
from mapmore_cli.study.loader import load

STUDIES = (
    ("m2/dmsp-20-88-static", "simulated", "pressure"),
    ("m2/peano-static", "simulated", "pressure"),
    ("festo/festo_10mm_10cm_pressure", "measured", "two bands of pressure"),
    ("festo/festo_10mm_10cm_strain", "measured", "a strain"),
    ("festo/festo_10mm_30cm_strain", "measured", "a strain"),
    ("pgm/pgm_force", "measured", "two pressures"),
)
"""Shipped studies of static force, and what each holds out."""

RIVALS = ("sarosi", *LEARNERS)


def row(study: str, runs: Path) -> tuple[float | int, ...]:
    """Training samples, and the NRMSE of every model on the held-out data of a study, in per
    cent.
    """
    name = study.rpartition("/")[2]
    files = run(study, runs, f"name={name}.baselines", f"validate.against=[{', '.join(RIVALS)}]")
    samples = sum(int(curve.training.sum()) for curve in files.dataset().curves)
    found = scores(files)
    return (samples, *(100 * found[model].nrmse for model in ("mapmore", *RIVALS)))


def baselines(runs: Path) -> Table:
    """Return a row for every study."""
    heads = ("study", "data", "held out", "training samples")
    columns = (*heads, *(f"{model} [%] .3g" for model in ("mapmore", *RIVALS)))
    rows = (
        (study.rpartition("/")[2], kind, held, *row(study, runs)) for study, kind, held in STUDIES
    )
    return Table.of("baselines", "NRMSE on the held-out data", columns, rows)


POLYNOMIALS = ("plane", "quadratic", "cubic")


def studies_of_papers() -> list[str]:
    """Return the simulated studies that have their paper's competitors alone, and hold something
    out.
    """
    found = []
    for folder in ("m1", "m2", "wrist", "muscle-like"):
        for path in sorted(
            path for path in (CONFIGS / folder).glob("*.yaml") if not path.name.startswith("_")
        ):
            loaded = load(path)
            spec = loaded.spec
            if (
                spec.data.split.hold_out is not None
                and not spec.validation.simple
                and "/datasets/" in loaded.resolved
            ):
                found.append(f"{folder}/{path.stem}")
    return found


def beside(study: str, runs: Path) -> dict[str, float]:
    """NRMSE on the held-out data, in per cent, of the model, its page's competitors, and
    polynomials of its inputs.
    """
    files = run(study, runs, f"name={study.rpartition('/')[2]}.polynomials", "validate.simple=true")
    return {
        model: 100 * one.nrmse for model, one in scores(files).items() if model != REPEATABILITY
    }


def polynomials(runs: Path) -> Table:
    """Return a row for every study of a paper."""
    rows: list[tuple[Cell, ...]] = []
    ahead = 0
    for study in studies_of_papers():
        found = beside(study, runs)
        best = min(
            (model for model in found if model not in (*SIMPLE, OWN)),
            key=found.__getitem__,
            default=None,
        )
        shown = [found[name] for name in POLYNOMIALS]
        rows.append(
            (
                study.rpartition("/")[2],
                found[OWN],
                best,
                None if best is None else found[best],
                *shown,
            )
        )
        ahead += min(shown) < found[OWN]
    columns = ("study", "mapmore [%] .3g", "best of its page", "its error [%] .3g")
    note = (
        f"In {ahead} of {len(rows)} studies, the best of the three polynomials (chosen after the "
        "errors were known) has a smaller error than mapmore."
    )
    polynomial = (f"{name} [%] .3g" for name in POLYNOMIALS)
    return Table.of(
        "polynomials", "NRMSE on the held-out data", (*columns, *polynomial), rows, note
    )


if __name__ == "__main__":
    write_page("baselines.md", {"baselines": baselines, "polynomials": polynomials})
