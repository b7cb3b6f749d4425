"""The JSON Schema of an experiment, with which editors complete and check a spec while it is typed,
and the reference of its keys.

`mapmore schema` prints the schema, of which `make schema` writes the one in `configs/`; `mapmore
schema keys` prints the reference.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core.core_schema import DataclassSchema, ModelSchema

from mapmore_cli.domain.declared import prose
from mapmore_cli.domain.scores import MEASURES, METRICS, OF_TARGET
from mapmore_cli.storage.atomic import write_text
from mapmore_cli.study.experiment import ExperimentSpec
from mapmore_cli.study.loader import SCHEMA
from mapmore_cli.study.tree import SourceText, quoted, written
from mapmore_cli.study.yaml_loader import parse

KEY = re.compile(r"^- `(\w+)`(?: \((.+?)\))?: (.*?)(?:, as `([^`]+)`)?$\n?", re.MULTILINE)
"""What the docstring of a section says of a key: `- `z_s` (its unit): what it is, as `0.25``."""


class _Documented(GenerateJsonSchema):
    """Says of every key what its declaration says: its text, its unit and an example. Leaves out
    the titles of fields, which only repeat their names.
    """

    def field_title_should_be_set(self, _schema: object) -> bool:
        return False

    def model_schema(self, schema: ModelSchema) -> JsonSchemaValue:
        """Return the schema of a section."""
        return _told(super().model_schema(schema), schema["cls"])

    def dataclass_schema(self, schema: DataclassSchema) -> JsonSchemaValue:
        """Return the schema of a section that the mathematics declares."""
        return _told(super().dataclass_schema(schema), schema["cls"])


def _told(section: JsonSchemaValue, of: type) -> JsonSchemaValue:
    """Return the schema of a section with what the docstrings of its class, and of those that it
    inherits from, say of its keys.
    """
    keys = section.get("properties", {})
    said_of = {
        match[1]: match
        for base in reversed(of.__mro__)
        for match in KEY.finditer(prose(vars(base).get("__doc__")))
        if match[1] in keys
    }
    own = prose(of.__doc__)
    about = KEY.sub(lambda match: "" if match[1] in said_of else match[0], own)
    for key, value in keys.items():
        unit = _unit_within(value)
        if key in said_of:
            _, own_unit, value["description"], example = said_of[key].groups()
            node = parse(SourceText("an example", Path(), example or "", numbered=False), [])
            value["examples"] = json.loads(json.dumps([written(node)]))  # plain, without places
            unit = own_unit or unit
        if unit is not None:
            value["unit"] = unit
    return {**section, "description": about.strip()}


def _unit_within(value: object) -> str | None:
    """Return the unit of the numbers that may stand at a key, taken out of what is said of each; 1
    for plain numbers, None if there are none.
    """
    if isinstance(value, list):
        return next((unit for part in value if (unit := _unit_within(part))), None)
    if not isinstance(value, dict):
        return None
    inner = _unit_within([part for key, part in value.items() if key not in ("default", "enum")])
    number = "1" if value.get("type") in ("number", "integer") else None
    return value.pop("unit", None) or inner or number


def _whole_schema() -> JsonSchemaValue:
    """Return the schema of a spec that inherits nothing, with `extends` first of its keys."""
    schema = ExperimentSpec.model_json_schema(schema_generator=_Documented)
    extends = {
        "type": "string",
        "description": "Another spec, from which this one inherits what it does not say itself.",
        "examples": ["base.yaml"],
    }
    schema["properties"] = {"extends": extends, **schema["properties"]}
    return schema


def json_schema() -> JsonSchemaValue:
    """Return the schema (draft 2020-12) of what a file may say: numbers may carry units, and what
    is required may be inherited.
    """
    schema = _whole_schema()
    sections = schema["$defs"]
    complete = {
        "required": schema.pop("required"),
        "properties": {"data": {"required": sections["Data"]["required"]}},
    }
    # `extends` merges mappings, and no lists
    for name in {*_sections_within(schema, sections, ("items", "prefixItems", "$defs", "default"))}:
        sections[name].pop("required", None)
    return {
        "$schema": GenerateJsonSchema.schema_dialect,
        **schema,
        "if": {"required": ["extends"]},
        "else": complete,
    }


def write_schema_beside(spec: Path) -> None:
    """Write the schema that the first line of a written spec names, where there is none yet."""
    path = spec.with_name(SCHEMA)
    if not path.exists():
        write_text(path, json.dumps(json_schema(), indent=2) + "\n")


def _sections_within(
    schema: object, sections: dict[str, Any], skipped: Sequence[str]
) -> Iterator[str]:
    """Yield the sections that a schema names, from top to bottom and however often, each followed
    by those inside it.
    """
    if isinstance(schema, list):
        for item in schema:
            yield from _sections_within(item, sections, skipped)
    elif isinstance(schema, dict):
        name = str(schema.get("$ref", "")).removeprefix("#/$defs/")
        if name in sections:
            yield name
            # Families within products are described there.
            others = {key: value for key, value in sections.items() if key != name}
            yield from _sections_within(sections[name], others, skipped)
        for key, value in schema.items():
            if key not in skipped:
                yield from _sections_within(value, sections, skipped)


# The reference of the keys
# --------------------------------------------------------------------------------------------------


def reference() -> str:
    """Return every section with its keys, values and defaults as Markdown, in the order of the
    pipeline, and the metrics of `require`.
    """
    schema = _whole_schema()
    names = dict.fromkeys(_sections_within(schema, schema["$defs"], ("$defs", "default")))
    sections = {
        "Top level": schema,
        **{_section_title(name): schema["$defs"][name] for name in names},
    }
    tables = [
        _section(title, section) for title, section in sections.items() if "properties" in section
    ]
    units = {name: "the target" if name in OF_TARGET else "1" for name in METRICS}
    lower = quoted((name for name, one in MEASURES.items() if one.at_least), " and ")
    return "\n".join([*tables, _METRICS.format(lower)]) + "".join(
        f"| `{name}` | {METRICS[name]} | {unit} |\n" for name, unit in units.items()
    )


_METRICS = """\
### Metrics

What `validate.require` may limit, as `{{nrmse: 0.05, r2: 0.9}}`: {} from below, all others from
above. A limit holds for the run's own model on the pooled validation rows, or on the training
rows where nothing is held out.

| metric | meaning | in units of |
|---|---|---|
"""


def _section(title: str, section: dict[str, Any]) -> str:
    required = section.get("required", [])
    rows = [
        f"| `{key}` | {_allowed(value)} | {_default(value, key in required)} | {_meaning(value)} |"
        for key, value in section["properties"].items()
        if key != "schema_version"
    ]
    about = [f"### {title}", "", section.get("description", ""), ""]
    return "\n".join(
        [*about, "| key | value | default | what it is |", "|---|---|---|---|", *rows, ""]
    )


def _allowed(value: dict[str, Any]) -> str:
    """Return what may stand at a key, in one cell."""
    if parts := value.get("anyOf", value.get("oneOf")):
        words = dict.fromkeys(map(_allowed, parts))
        return " or ".join(word for word in words if word != "nothing")
    if "$ref" in value:
        name = _section_title(value["$ref"].rpartition("/")[2])
        return f"[{name}](#{name.lower().replace(' ', '-')})"
    if "enum" in value or "const" in value:
        return quoted(value.get("enum", [value.get("const")]), " or ")
    if value.get("type") == "array":
        return f"list of {_allowed(value.get('items', {})) or 'values'}"
    if value.get("type") == "object":
        inner = value.get("additionalProperties")
        return f"mapping to {_allowed(inner)}" if isinstance(inner, dict) else "mapping"
    if str(value.get("pattern", "")).startswith(r"^\s*[-+]?"):
        return "with unit"
    bounds = [f" {sign} {value[key]:g}" for key, sign in _SIGNS.items() if key in value]
    return "".join([_WORDS.get(value.get("type", ""), "value"), *bounds])


_SIGNS = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}
_WORDS = {
    "string": "text",
    "number": "number",
    "integer": "whole number",
    "boolean": "`true` or `false`",
    "null": "nothing",
}


def _default(value: dict[str, Any], required: bool) -> str:
    default = value.get("default")
    if required or default is None or isinstance(default, dict):
        return "**required**" if required else ""
    return f"`{json.dumps(default, ensure_ascii=False)}`"


def _meaning(value: dict[str, Any]) -> str:
    """Return what a key is, its unit and an example, in one cell."""
    unit = value.get("unit", "1")
    words = [value.get("description", ""), *([f"unit: {unit}"] if unit != "1" else [])]
    words += [f"as `{json.dumps(one, ensure_ascii=False)}`" for one in value.get("examples", ())]
    return "; ".join(words).replace("|", "\\|")


def _section_title(name: str) -> str:
    """Return `DictionaryEntry` as words; a class whose name occurs twice begins with its module
    (`...__data__Rate`).
    """
    module, _, last = name.rpartition("__")
    words = module.rpartition("__")[2].capitalize() + last.replace("_", "")
    return "".join(
        f" {letter.lower()}" if letter.isupper() and place else letter
        for place, letter in enumerate(words)
    )
