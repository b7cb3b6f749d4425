"""A stored dataclass needs no layout of its own: what its fields are says how they lie in a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

import h5py
import numpy as np
import pytest
from annotated_types import Interval
from hypothesis import HealthCheck, given, settings
from stored_records import records, same

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.models import Fusion
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling.kinds import kinds
from mapmore_cli.storage.artefacts.codecs import Label
from mapmore_cli.storage.artefacts.layout import stored_types
from mapmore_cli.storage.artefacts.schema import LAYOUTS, check_lengths, schema_of


@dataclass(frozen=True)
class Spring:
    """A body of another kind."""

    stiffness: Annotated[float, Interval(ge=0), "force over displacement"]
    shape: Literal["straight", "coiled"]
    ends: tuple[Quantity, ...]
    names: tuple[str, ...]
    course: Array
    limits: Mapping[str, tuple[float, float]]
    sizes: Mapping[str, float] = field(default_factory=dict)
    preload: float | None = None
    turns: int = 1


SPRING = Spring(2.0, "coiled", (Quantity("force", "N"),), ("a", "b"), np.array([1.0, 2.0]), {"force": (0.0, 1.0)}, {"pitch": 0.5}, 0.1, 7)


def stored(tmp_path, record):
    """What comes back of a record from a file."""
    schema = schema_of(type(record))
    with h5py.File(tmp_path / "record.h5", "w") as file:
        schema.write_into(file, record, Label())
    with h5py.File(tmp_path / "record.h5") as file:
        return schema.read_from(file)


def test_every_form_comes_back(tmp_path):
    found = stored(tmp_path, SPRING)
    np.testing.assert_array_equal(found.course, SPRING.course)
    assert replace(found, course=SPRING.course) == SPRING


@pytest.mark.parametrize("schema", stored_types(), ids=lambda s: s.type.__name__)
def test_every_stored_type_comes_back(schema, tmp_path):
    @settings(max_examples=4, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large])
    @given(records(schema.type))
    def comes_back(record):
        assert same(stored(tmp_path, record), record)
        check_lengths(record)

    comes_back()


def test_a_file_without_a_field_holds_its_default(tmp_path):
    stored(tmp_path, SPRING)
    with h5py.File(tmp_path / "record.h5", "a") as file:
        del file.attrs["turns"], file["sizes"]
        found = schema_of(Spring).read_from(file)
    assert (found.turns, found.sizes) == (1, {})


def test_a_key_that_is_added_to_the_joining_is_stored(tmp_path, monkeypatch):
    @dataclass(frozen=True, kw_only=True)
    class Joined(Fusion):
        order: int = 3

    monkeypatch.setitem(LAYOUTS, Joined, LAYOUTS[Fusion])
    assert [field.name for field in schema_of(Joined).fields] == [*(field.name for field in schema_of(Fusion).fields), "order"]
    made = Joined(extrapolation={"strain": ("continue", 0.5)}, z_s=0.1, order=5)
    assert stored(tmp_path, made) == made


def test_kinds_are_found_by_their_folders():
    found = {kind.name: kind for kind in kinds()}
    assert list(found) == ["formula", "memory", "pieces", "state_space", "sum"]
    for kind in found.values():
        assert all(callable(kind.verb(name)) for name in ("simulate", "equations", "parameters", "write"))
