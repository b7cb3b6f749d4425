"""Make the JSON Schema of a spec, and the reference of its keys. With the schema, editors complete
and check a spec while it is typed.

`mapmore schema` prints the schema (`make schema` writes it to `configs/`), and `mapmore schema
keys` prints the reference.
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
from mapmore_cli.storage.atomic import write_own
from mapmore_cli.study.experiment import ExperimentSpec
from mapmore_cli.study.loader import SCHEMA
from mapmore_cli.study.tree import SourceText, quoted, written
from mapmore_cli.study.yaml_loader import parse

KEY = re.compile(
    r"^- `(\w+)`(?: \((.+?)\))?: (.*?)(?:(?:, as|\.? Example:) `([^`]+)`)?$\n?", re.MULTILINE
)
"""Pattern of a line that explains a key in the docstring of a section: `- `z_s` (unit): text.
Example: `0.25``.
"""


class _Documented(GenerateJsonSchema):
    """Generator of the schema. It adds the explanation, the unit and the example of every key,
    which it takes from docstrings. It leaves out the titles of keys, which only repeat their names.
    """

    def field_title_should_be_set(self, _schema: object) -> bool:
        return False

    def model_schema(self, schema: ModelSchema) -> JsonSchemaValue:
        """Return the schema of a section."""
        return _told(super().model_schema(schema), schema["cls"])

    def dataclass_schema(self, schema: DataclassSchema) -> JsonSchemaValue:
        """Return the schema of a dataclass that a module of the mathematics declares."""
        return _told(super().dataclass_schema(schema), schema["cls"])


def _told(section: JsonSchemaValue, of: type) -> JsonSchemaValue:
    """Return the schema of a section, with the explanations of its keys from the docstrings of its
    class and its base classes.
    """
    keys = section.get("properties", {})
    said_of = {
        match[1]: match
        for base in reversed(of.__mro__)
        for match in KEY.finditer(prose(vars(base).get("__doc__")))
        if match[1] in keys
    }
    text = prose(of.__doc__)
    about = KEY.sub(lambda match: "" if match[1] in said_of else match[0], text)
    for key, value in keys.items():
        unit = _unit_within(value)
        if key in said_of:
            _, own_unit, value["description"], example = said_of[key].groups()
            node = parse(SourceText("an example", Path(), example or ""), [])
            # copies of the values as plain JSON, without the places at which they are written
            value["examples"] = json.loads(json.dumps([written(node)]))
            unit = own_unit or unit
        if unit is not None:
            value["unit"] = unit
    return {**section, "description": about.strip()}


def _unit_within(value: object) -> str | None:
    """Remove the unit of the numbers at a key from all parts of the schema of this key, and return
    the unit: `1` for plain numbers, None if the key takes no numbers.
    """
    if isinstance(value, list):
        return next((unit for part in value if (unit := _unit_within(part))), None)
    if not isinstance(value, dict):
        return None
    inner = _unit_within([part for key, part in value.items() if key not in ("default", "enum")])
    number = "1" if value.get("type") in ("number", "integer") else None
    return value.pop("unit", None) or inner or number


def _whole_schema() -> JsonSchemaValue:
    """Return the schema of a spec that inherits nothing. Its first key is `extends`."""
    schema = ExperimentSpec.model_json_schema(schema_generator=_Documented)
    extends = {
        "type": "string",
        "description": "Another spec. Keys that are not set here are taken from it.",
        "examples": ["base.yaml"],
    }
    schema["properties"] = {"extends": extends, **schema["properties"]}
    return schema


def json_schema() -> JsonSchemaValue:
    """Return the schema (draft 2020-12) of a spec file. Numbers may have units, and required keys
    may be inherited.
    """
    schema = _whole_schema()
    sections = schema["$defs"]
    complete = {
        "required": schema.pop("required"),
        "properties": {"data": {"required": sections["Data"]["required"]}},
    }
    # A spec with `extends` may inherit the required keys of mappings, so mappings require no keys.
    # A list replaces the inherited list as a whole, so that list items still require their keys.
    for name in {*_sections_within(schema, sections, ("items", "prefixItems", "$defs", "default"))}:
        sections[name].pop("required", None)
    return {
        "$schema": GenerateJsonSchema.schema_dialect,
        **schema,
        "if": {"required": ["extends"]},
        "else": complete,
    }


def write_schema_beside(spec: Path) -> Path | None:
    """Write the schema file that the first line of a spec names, and return its path. If the file
    exists already, write nothing and return None.
    """
    path = spec.with_name(SCHEMA)
    if path.exists():
        return None
    write_own(path, json.dumps(json_schema(), indent=2) + "\n")
    return path


def _sections_within(
    schema: object, sections: dict[str, Any], skipped: Sequence[str]
) -> Iterator[str]:
    """Yield the names of the sections to which a schema refers, from top to bottom. Each name is
    followed by the sections inside this section. A name can occur several times.
    """
    if isinstance(schema, list):
        for item in schema:
            yield from _sections_within(item, sections, skipped)
    elif isinstance(schema, dict):
        name = str(schema.get("$ref", "")).removeprefix("#/$defs/")
        if name in sections:
            yield name
            # a section that contains itself, such as `products`, is not followed inside itself
            others = {key: value for key, value in sections.items() if key != name}
            yield from _sections_within(sections[name], others, skipped)
        for key, value in schema.items():
            if key not in skipped:
                yield from _sections_within(value, sections, skipped)


# Reference of keys
# --------------------------------------------------------------------------------------------------


def reference() -> str:
    """Return the reference as Markdown: every section with its keys, values and defaults in the
    order of the pipeline, and the metrics of `require`.
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
    lower = quoted(name for name, measure in MEASURES.items() if measure.at_least)
    return "\n".join([*tables, _METRICS.format(" and ".join(lower.rsplit(", ", 1)))]) + "".join(
        f"| `{name}` | {METRICS[name]} | {unit} |\n" for name, unit in units.items()
    )


_METRICS = """\
### Metrics

The key `validate.require` sets limits for metrics, for example `{{nrmse: 0.05, r2: 0.9}}`. A limit
of {} is the smallest value that is allowed. A limit of any other metric is the largest value that
is allowed. Limits are compared with the scores of the run's own model on all held-out data, or on
the training data if nothing is held out.

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
    """Return the table cell with the values that a key accepts."""
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
    """Return the table cell with the meaning of a key, its unit and an example."""
    unit = value.get("unit", "1")
    text = value.get("description", "")
    sentences = [text[:1].upper() + text[1:], *([f"Unit: {unit}"] if unit != "1" else [])]
    examples = [json.dumps(example, ensure_ascii=False) for example in value.get("examples", ())]
    sentences += [f"Example: `{example}`" for example in examples]
    ended = [sentence.removesuffix(".") + "." for sentence in sentences if sentence]
    return " ".join(ended).replace("|", "\\|")


def _section_title(name: str) -> str:
    """Return the name of a class as words: `DictionaryEntry` is `Dictionary entry`. If two classes
    have the same name, the name of the module is put before it.
    """
    module, _, last = name.rpartition("__")
    words = module.rpartition("__")[2].capitalize() + last.replace("_", "")
    return "".join(
        f" {letter.lower()}" if letter.isupper() and place else letter
        for place, letter in enumerate(words)
    )
