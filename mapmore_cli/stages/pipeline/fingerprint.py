"""What a stage's numbers depend on, as one hash, and the difference between two slices of a spec in words."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

from pydantic import BaseModel

from mapmore_cli.spec.experiment import ExperimentSpec
from mapmore_cli.spec.tree import keys_at

LONGEST_VALUE = 60
"""Characters of a value that a difference shows."""

NOT_SET = "not set"


def plain(value: Any) -> Any:
    """A slice (frozen dataclasses, spec models and what they hold) as JSON values, under the names of the YAML file."""
    if isinstance(value, BaseModel):
        return {field.alias or name: plain(getattr(value, name)) for name, field in type(value).model_fields.items()} | plain(
            value.model_extra or {}
        )
    if is_dataclass(value):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    return value


def fingerprint(name: str, revision: int, part: Any, before: str, contents: Mapping[str, str]) -> str:
    """SHA-256 of a stage's name and revision, its slice `part`, the fingerprint `before` it, and the hashes of its sources by path."""
    whole = {"stage": name, "revision": revision, "slice": part, "before": before, "sources": contents}
    canonical = json.dumps(whole, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(canonical.encode()).hexdigest()


def slice_differences(stage: str, old: Any, new: Any) -> list[str]:
    """Every changed key of a stage's slice with both values, as `fuse.z_s: 0.25 -> 0.3`."""
    if not isinstance(old, dict) or not isinstance(new, dict):
        return list(_differences(stage, old, new))
    keys = [*new, *(key for key in old if key not in new)]
    return [text for key in keys for text in _differences(place_in_spec(key, stage), old.get(key, NOT_SET), new.get(key, NOT_SET))]


def place_in_spec(key: str, stage: str) -> str:
    """Where a key of a stage's slice stands in the YAML file: `levels` is `data.levels`, `against` is `validate.against`."""
    sections = {field.alias or name: field.annotation for name, field in ExperimentSpec.model_fields.items()}
    if key in sections:
        return key
    homes = [name for name, section in sections.items() if isinstance(section, type) and key in keys_at(section, ())]
    return f"{homes[0] if homes else stage}.{key}"  # `levels` of fuse stands inside its own section, so the first home is the one


def _differences(place: str, old: Any, new: Any) -> Iterator[str]:
    if isinstance(old, dict) and isinstance(new, dict):
        for key in [*new, *(key for key in old if key not in new)]:
            yield from _differences(f"{place}.{key}", old.get(key, NOT_SET), new.get(key, NOT_SET))
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new) and any(isinstance(part, dict) for part in new):
        for number, (before, after) in enumerate(zip(old, new, strict=True)):
            yield from _differences(f"{place}[{number}]", before, after)
    elif old != new:
        was, now = _shown(old), _shown(new)
        yield f"{place}: {was} -> {now}" if was != now else f"{place} changed"


def _shown(value: Any) -> str:
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
    return text if len(text) <= LONGEST_VALUE else f"{text[: LONGEST_VALUE - 1]}…"
