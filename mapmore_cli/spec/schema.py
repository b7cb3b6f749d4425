"""The JSON Schema of an experiment, with which editors complete and check a spec while it is typed.

`python -m mapmore_cli.spec.schema FILE` writes it; the one in `configs/` is checked in.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue

from mapmore_cli.spec.experiment import ExperimentSpec


class _Untitled(GenerateJsonSchema):
    """Leaves out the titles of fields, which only repeat their names."""

    def field_title_should_be_set(self, _schema: Any) -> bool:
        return False


def json_schema() -> JsonSchemaValue:
    """Return the schema (draft 2020-12) of what a file may say: numbers may carry units, and what is required may be inherited."""
    schema = ExperimentSpec.model_json_schema(schema_generator=_Untitled)
    sections = schema["$defs"]
    complete = {"required": schema.pop("required"), "properties": {"data": {"required": sections["Data"]["required"]}}}
    for name in _merged_sections(schema, sections):
        sections[name].pop("required", None)
    schema["properties"] = {
        "extends": {"type": "string", "description": "Another spec, from which this one inherits what it does not say itself."},
        **schema["properties"],
    }
    return {"$schema": GenerateJsonSchema.schema_dialect, **schema, "if": {"required": ["extends"]}, "else": complete}


def _merged_sections(schema: Any, sections: dict[str, Any]) -> set[str]:
    """Sections that a file may say in part, since `extends` merges mappings; the items of lists are always whole."""
    if isinstance(schema, list):
        return set().union(*(_merged_sections(item, sections) for item in schema))
    if not isinstance(schema, dict):
        return set()
    name = str(schema.get("$ref", "")).removeprefix("#/$defs/")
    found = {name, *_merged_sections(sections[name], sections)} if name else set()
    inside = [value for key, value in schema.items() if key not in ("items", "prefixItems", "$defs", "default")]
    return found.union(*(_merged_sections(value, sections) for value in inside))


def schema_text() -> str:
    """Return the schema as it is checked in."""
    return json.dumps(json_schema(), indent=2, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    Path(sys.argv[1] if len(sys.argv) > 1 else "configs/experiment.schema.json").write_text(schema_text(), encoding="utf-8")
