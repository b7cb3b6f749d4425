"""Describe the part of a spec on which a stage depends: as JSON values for the record of the run,
as a hash (fingerprint), and by the differences between an old and a new part.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from typing import Any

from pydantic_core import to_jsonable_python

from mapmore_cli.study.experiment import ExperimentSpec

LONGEST_VALUE = 60
"""Largest number of characters of a value in a difference."""

NOT_SET = "not set"


def recorded(part: object) -> dict[str, Any]:
    """Return `part`, the part of a spec that a stage reads, as JSON values. It is a dataclass or a
    pydantic model, and may contain more of them. The keys are those of the YAML file.
    """
    values: dict[str, Any] = to_jsonable_python(part, by_alias=True)
    return values


def fingerprint(
    name: str, revision: int, part: object, before: str, contents: Mapping[str, str]
) -> str:
    """Return the fingerprint of a stage: the SHA-256 of everything on which its result depends.
    This is the name and the revision of the stage, the part of the spec that it reads (`part`), the
    fingerprint of the stage before it (`before`), and the hash of each source file by path
    (`contents`).
    """
    whole = {
        "stage": name,
        "revision": revision,
        "slice": part,
        "before": before,
        "sources": contents,
    }
    canonical = json.dumps(whole, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(canonical.encode()).hexdigest()


def slice_differences(stage: str, old: object, new: Mapping[str, Any]) -> list[str]:
    """Return the keys that differ between the old and the new part of the spec that a stage reads,
    each with both values, for example `fuse.z_s: 0.25 -> 0.3`.
    """
    if old == new:
        return []
    # somebody may have edited the record of the run, so that `old` may have any type
    if not isinstance(old, dict):
        return list(_differences(stage, old, new))
    return [
        text
        for key in {**new, **old}
        for text in _differences(
            place_in_spec(key, stage), old.get(key, NOT_SET), new.get(key, NOT_SET)
        )
    ]


def place_in_spec(key: str, stage: str) -> str:
    """Return the full name that a key of a stage has in the spec. For example, `levels` is
    `data.levels`, and `against` is `validate.against`.
    """
    fields = ExperimentSpec.model_fields.items()
    sections = {field.alias or name: field.annotation for name, field in fields}
    if key in sections:
        return key
    # `levels` is a key of `data` and of `fuse`. Here it is the key of `data`: stages that read
    # `fuse` read the whole section, so that a change in it has the key `fuse` (returned above).
    for name, section in sections.items():
        if key in getattr(section, "model_fields", getattr(section, "__dataclass_fields__", ())):
            return f"{name}.{key}"
    return f"{stage}.{key}"


def _differences(place: str, old: object, new: object) -> Iterator[str]:
    """Yield the differences between the old and the new value of a key of the spec. If both values
    are mappings, or lists of mappings with equal lengths, only the elements that differ are
    described, each with its full name, such as `dictionary[0].order`.
    """
    if isinstance(old, dict) and isinstance(new, dict):
        for key in new | old:
            yield from _differences(f"{place}.{key}", old.get(key, NOT_SET), new.get(key, NOT_SET))
    elif (
        isinstance(old, list)
        and isinstance(new, list)
        and len(old) == len(new)
        and any(isinstance(part, dict) for part in new)
    ):
        for number, (before, after) in enumerate(zip(old, new, strict=True)):
            yield from _differences(f"{place}[{number}]", before, after)
    elif old != new:
        was, now = _shortened(old), _shortened(new)
        yield f"{place}: {was} -> {now}" if was != now else f"{place} changed"


def _shortened(value: object) -> str:
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= LONGEST_VALUE else f"{text[: LONGEST_VALUE - 1]}…"
