"""Provide `fit`, with the sections of a spec as keyword arguments, and example data."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mapmore_cli.api.fitted import HERE, Fitted, Study
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import SpecError
from mapmore_cli.pipeline.example import example_recordings
from mapmore_cli.pipeline.frames import labels_of
from mapmore_cli.pipeline.tables_in_memory import (
    canonical_columns,
    plain_values,
    with_canonical_columns,
)
from mapmore_cli.storage.readers import reader_of
from mapmore_cli.study.diagnostics import did_you_mean
from mapmore_cli.study.sections.data import Data

Section = Mapping[str, Any]
"""A section of the spec, with the keys of the YAML file."""


def fit(
    frame: object,
    *,
    target: str | Section = "static",
    columns: Section | None = None,
    levels: Section | None = None,
    split: Section | None = None,
    segment: Mapping[str, str | Section] | None = None,
    dictionary: Sequence[Section] | None = None,
    model: Section | None = None,
    fit: Section | None = None,
    fuse: Section | None = None,
    validate: Section | None = None,
    formulas: Sequence[str | Section] | None = None,
    muscle: Section | None = None,
    units: Mapping[str, str] | None = None,
    needs: Section | None = None,
    data: Section | None = None,
    report: Section | None = None,
    name: str = "model",
    schema_version: int = 1,
    check: bool = True,
    progress: bool | None = None,
    **of_data: object,
) -> Fitted:
    """Fit a model to a table, with the sections of a spec as keyword arguments.

    Parameters
    ----------
    frame
        A mapping of arrays, a data frame (pandas, polars, pyarrow and others), the path of a file,
        or a list of these. Each element of a list is one recording. `column: 2` means the column
        with the label 2, or the third column if no label is a number. The index of a data frame is
        ignored. Masked values, None and `pd.NA` are missing values. Arrays with units (pint,
        astropy, xarray) are converted. `time` may contain dates or durations. Texts, booleans
        (`True` and `False`) and complex numbers are refused. These rules also hold for the inputs
        of a fitted model.
    columns
        Which column contains which quantity. A column needs no entry if its label is the name of a
        known quantity, for example `time`, `pressure`, `strain` or `force`. If `columns` is left
        out and `target` is the label of a column, every column becomes a quantity that is named by
        its label.
    target
        What the model predicts: the `static`, `hysteresis`, `damping` or `dynamic` force, a
        quantity, or several quantities that share segments and terms.
    levels
        The quantity that is constant within a curve, for example `{"of": "pressure", "at":
        "auto"}`.
    split
        Which data are held out of training, for example `dict(validate=dict(pressure=[250]))`.
    segment
        How the range of each variable is cut into segments, for example `{"strain": {"method":
        "even", "count": 4}}`. For the level quantity, the value `none` pools the curves of all
        levels into one.
    dictionary
        Kinds of candidate terms, for example `[dict(polynomial=dict(of=["strain"],
        order=4))]`.
    model
        Kind of the model, and the formula to which the segment functions are added, for example
        `{"backbone": "sarosi"}`.
    fit
        How terms are chosen, and how many terms, for example `{"max_terms": 2}`.
    fuse
        How the segment functions are joined, and what the model does outside the measured range,
        for example `{"transition": "linear", "z_s": 0.25}`.
    validate
        Competitors of the model, and limits for its scores, for example `dict(against=["sarosi"],
        require=dict(nrmse=0.05))`.
    formulas
        Formulas that you define yourself, each as a file or as a mapping, for example
        `["my_formula.yaml"]`.
    muscle
        The muscle that was measured, for example `{"length": "88 mm", "diameter": "20 mm"}`.
    units
        Units of quantities in the model and on pages, for example `{"pressure": "bar"}`.
    needs
        Specs of other runs on which this study builds, for example `{"static": "static.yaml"}`.
    report
        Figures and files of the report, for example `dict(formats=["html", "pdf"])`.
    name
        Name of the model.
    check
        With `check=False`, an error of `mapmore check` becomes a warning, and the fit goes on.
    progress
        Whether a progress bar is shown. True shows a bar at once, and False never shows one. By
        default, a terminal or a notebook shows a bar after two seconds.
    of_data
        Other keys of the section `data`, for example `cycles`, `resample` or `derive`.

    Raises
    ------
    SpecError
        A section of the spec has a mistake.
    DataError, FitError
        The data have a mistake, or a fit failed.

    Examples
    --------
    >>> import numpy as np
    >>> import mapmore_cli as mm
    >>> levels, strains = [0.8, 1.5, 2.0, 2.5, 3.5], np.linspace(0, 0.2, 40)
    >>> bar, eps = (grid.ravel() for grid in np.meshgrid(levels, strains, indexing="ij"))
    >>> newton = 330 * bar * (1 - 3.2 * eps) ** 2 - 70 + 40 * np.exp(-eps / 0.02)
    >>> m = mm.fit({"P [bar]": bar, "eps": eps, "F": newton}, target="static",
    ...     columns={"pressure": {"column": "P [bar]", "unit": "bar"}, "strain": {"column": "eps"},
    ...              "force": {"column": "F"}},
    ...     levels={"of": "pressure", "at": "auto"}, split={"validate": {"pressure": [200]}},
    ...     segment={"strain": {"method": "even", "count": 4}},
    ...     dictionary=[{"polynomial": {"of": ["strain"], "order": 4}}],
    ...     validate={"against": ["sarosi"]})
    >>> m
    <model model: force [N] of pressure [kPa], strain [1]>
    ...
    >>> m.scores.of_model()["nrmse"] < 0.01
    True
    >>> float(m(pressure=150, strain=0.1).round())
    157.0
    >>> pressure = m.invert("pressure", force=100, strain=0.1).picked
    >>> float(m(pressure=pressure[0], strain=0.1).round(6))
    100.0
    """
    sections = {
        "target": target,
        "segment": segment,
        "dictionary": dictionary,
        "model": model,
        "fit": fit,
        "fuse": fuse,
        "validate": validate,
        "formulas": formulas,
        "muscle": muscle,
        "units": units,
        "needs": needs,
        "report": report,
        "name": name,
        "schema_version": schema_version,
    }
    of_data = {"columns": columns, "levels": levels, "split": split, **of_data}
    for key in sorted(of_data.keys() - Data.model_fields.keys()):
        raise SpecError(
            f"{HERE}: unknown key `{key}`", did_you_mean(key, [*sections, *Data.model_fields])
        )
    data_keys = {key: value for key, value in of_data.items() if value is not None}
    data_section, frames = _data_of(frame, {**(data or {}), **data_keys}, target)
    document = {key: value for key, value in sections.items() if value is not None}
    study = Study(
        plain_values({**document, "data": data_section}), frames, Path.cwd(), check, progress
    )
    fitted = study.fitted()
    for warning in (*fitted.scores.table.warnings, *fitted.doubts):
        warnings.warn(warning, stacklevel=2)
    return fitted


def _data_of(
    frame: object, section: dict[str, Any], target: object
) -> tuple[dict[str, Any], tuple[Any, ...]]:
    """Return the section `data`, and the frames in memory. If files are read, there are no frames.
    Raises SpecError if there is no table, or if frames and files are mixed.
    """
    tables = list(frame) if isinstance(frame, list | tuple) else [frame]
    frames = tuple(table for table in tables if labels_of(table) is not None)
    if not tables or 0 < len(frames) < len(tables):
        raise SpecError(
            "fit: the list contains both frames and file names"
            if tables
            else "fit: there are no frames",
            "give frames only, or file names only",
        )
    if frames and "columns" not in section:
        section["columns"] = canonical_columns(frames[0], target)
    elif frames and isinstance(section["columns"], Mapping):
        made = {*(section.get("derive") or ()), *(("time",) * ("sample_time" in section))}
        section["columns"] = with_canonical_columns(frames, section["columns"], made)
    if not frames:
        section["files"] = [str(path) for path in tables]
        section.setdefault("reader", _reader_of(tables[0]))
    return section, frames


def _reader_of(path: object) -> str:
    """Return the name of the reader for a file, chosen by the ending of the file name; `csv` for an
    unknown ending. Raises SpecError if the value is not a path.
    """
    if not isinstance(path, str | Path):
        raise SpecError(
            f"fit: a {type(path).__name__} is not a table",
            "give a mapping of arrays, a data frame, or the path of a file",
        )
    reader = reader_of(Path(path))
    return "csv" if reader is None else reader.name


def example() -> list[dict[str, Array]]:
    """Return four load cycles of a simulated Peano muscle, as `mapmore example` writes them.

    Each cycle is a recording at one pressure (80, 200, 350 or 500 kPa). Each
    recording has the columns `time` in s, `pressure` in kPa, `strain` (without a unit) and `force`
    in N, shape (n,) each.

    Examples
    --------
    >>> import mapmore_cli as mm
    >>> m = mm.fit(mm.example(), cycles={"over": "strain", "samples": 200},
    ...     levels={"of": "pressure", "at": [80, 200, 350, 500]},
    ...     split={"validate": {"pressure": [350]}}, model={"type": "literature", "name": "sarosi"})
    >>> m.scores.of_model()["n"]
    200
    """
    return example_recordings()
