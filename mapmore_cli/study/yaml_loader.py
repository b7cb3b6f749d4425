"""Read YAML with the scalars of YAML 1.2's core schema.

Plain PyYAML follows YAML 1.1, in which `1e-3` is text, `no` is false, `010` is eight and `1:30` is
ninety.
"""

from __future__ import annotations

import gc
import re
from functools import lru_cache
from pathlib import Path

import yaml

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.storage.inputs import note_read
from mapmore_cli.study.diagnostics import Mistake, fail
from mapmore_cli.study.tree import Node, Position, SourceText
from mapmore_cli.study.yaml_faults import DEEPEST, explain_fault, position_at

TAG = "tag:yaml.org,2002:"

SCALARS = {
    "null": r"~|null|Null|NULL|",
    "bool": r"true|True|TRUE|false|False|FALSE",
    "int": r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+",
    "float": r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?"
    r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)",
}

RESOLVERS = {
    None: [
        (TAG + tag, re.compile(f"(?:{pattern})\\Z", re.ASCII)) for tag, pattern in SCALARS.items()
    ]
}
"""Table by which PyYAML finds the type of an unquoted scalar: tags with patterns, which it tries in
this order. The key None means any first character.
"""


class CoreLoader(yaml.SafeLoader):
    """Loader of PyYAML that gives scalars the types of YAML 1.2's core schema. The key `<<`, with
    which YAML 1.1 merges mappings, is an ordinary key.
    """

    yaml_implicit_resolvers = RESOLVERS
    _depth = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """Return a node. Raises an error if it is nested too deeply, because PyYAML would recurse
        until Python's limit.
        """
        self._depth += 1
        if parent is not None and self._depth > DEEPEST:
            problem = f"nested more than {DEEPEST} levels deep"
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=parent.start_mark)
        node: yaml.Node | None = super().compose_node(parent, index)
        self._depth -= 1
        return node


def tag_of(text: str) -> str:
    """Return the core-schema type of an unquoted scalar: `null`, `bool`, `int`, `float` or
    `str`.
    """
    tags = (tag.removeprefix(TAG) for tag, pattern in RESOLVERS[None] if pattern.match(text))
    return next(tags, "str")


# largest size of a file in bytes; it is enough for a campaign of a hundred thousand runs
LARGEST = 5_000_000

KEPT = 100_000  # largest number of characters of a text that is cached

# largest number of values that aliases may repeat; nine levels of nine aliases would make 4e8
_MOST_VALUES = 50_000


def refuse_pipe(path: Path) -> None:
    """Raise SpecError for a pipe or a device in place of a spec, without opening it."""
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise SpecError(
            f"{path}: is a pipe or a device; a spec has to be a file, because it is read several "
            "times, paths in it are relative to its folder, and the run stores its path",
            "write it to a file, for example with `... > spec.yaml`, and give the path of the file",
        )


def read_source(path: Path) -> SourceText:
    """Return the text of a file.

    Raises SpecError for a file that is missing, unreadable, larger than a spec can be, or not in
    UTF-8, and for a pipe or a device.
    """
    note_read([path])
    refuse_pipe(path)
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST + 1)
    except OSError as error:
        raise SpecError(
            f"{path}: {(error.strerror or str(error)).lower()}", "give the path of a YAML file"
        ) from error
    if len(data) > LARGEST:
        raise SpecError(
            f"{path}: larger than {LARGEST // 1000} kB",
            "give the path of a spec; this seems to be a data file",
        )
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        column = error.start - data.rfind(b"\n", 0, error.start)
        raise SpecError(
            f"{path}:{line}:{column}: byte 0x{data[error.start]:02x} is not UTF-8",
            "save the file as UTF-8",
        ) from error
    return SourceText(str(path), path.parent, text)


def parse(source: SourceText, problems: list[Mistake]) -> Node:
    """Return the tree of a YAML text. If a key occurs twice in a mapping, a mistake is added to
    `problems`.

    Raises SpecError for text that is not YAML, that is nested too deeply, or whose aliases multiply
    too much.
    """
    root, mistakes = (_remembered if len(source.text) < KEPT else _tree_of)(source)
    problems += mistakes
    return root


def _tree_of(source: SourceText) -> tuple[Node, tuple[Mistake, ...]]:
    try:
        root = _composed(source.text)
    except yaml.YAMLError as error:
        explain_fault(error, source)
    # PyYAML calls `chr`, which raises these errors for an invalid character number
    except (ValueError, OverflowError):
        escape = re.search(r"\\U(?!00(?:0|10))[0-9A-Fa-f]{8}", source.text)
        fault = f"{(escape[0] if escape else 'an escape')} is not a Unicode character"
        at = position_at(source, escape.start() if escape else 0)
        fail(at, fault, "write the character itself")
    problems: list[Mistake] = []
    tree = (
        Node(None, Position(source, 1, 1))
        if root is None
        else _Builder(source, problems).node(root, depth=0)
    )
    return tree, tuple(problems)


_remembered = lru_cache(maxsize=16)(_tree_of)
"""`_tree_of` with a cache, for a spec on which many runs of a campaign are based."""


def _composed(text: str) -> yaml.Node | None:
    """Return the nodes of a text. The garbage collector is switched off while the text is parsed:
    all objects of a long text are alive, and scanning them takes minutes.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        node: yaml.Node | None = CoreLoader(text).get_single_node()
        return node
    finally:
        if enabled:
            gc.enable()


class _Builder:
    def __init__(self, source: SourceText, problems: list[Mistake]) -> None:
        self.source = source
        self.problems = problems
        self.seen: set[int] = set()
        self.repeated = 0

    def node(self, node: yaml.Node, depth: int, key_at: Position | None = None) -> Node:
        """Return the tree of values under one node of PyYAML."""
        at = self._position(node)
        self.repeated += id(node) in self.seen
        self.seen.add(id(node))
        if depth > DEEPEST:
            fail(
                at, "aliases nest too deeply, or an anchor contains itself", "write the values out"
            )
        if self.repeated > _MOST_VALUES:
            fail(at, f"aliases multiply to more than {_MOST_VALUES} values", "write the values out")
        if isinstance(node, yaml.MappingNode):
            return Node(self._mapping(node, depth), at, key_at)
        if isinstance(node, yaml.SequenceNode):
            return Node([self.node(item, depth + 1) for item in node.value], at, key_at)
        assert isinstance(node, yaml.ScalarNode)
        try:
            return Node(_scalar_value(node.tag, node.value), at, key_at)
        except ValueError as error:
            self.problems.append(Mistake(at, str(error), "write a plain value"))
            return Node(str(node.value), at, key_at)

    def _mapping(self, node: yaml.MappingNode, depth: int) -> dict[str, Node]:
        children: dict[str, Node] = {}
        before: yaml.Node | None = None
        for key, value in node.value:
            at, number, before = self._position(key), before, value
            if number is not None and self._is_after_comma(key, value, number):
                text = f"{number.value},{key.value}"
                remedy = f"write it with a decimal point: `{text.replace(',', '.')}`"
                self.problems.append(Mistake(at, f"`{text}` has a decimal comma", remedy))
            elif not (isinstance(key, yaml.ScalarNode) and key.tag.endswith(":str")):
                shown = f"`{key.value}`" if isinstance(key, yaml.ScalarNode) else "this key"
                self.problems.append(
                    Mistake(at, f"{shown} is not text, but keys must be text", "quote it")
                )
            elif key.value in children:
                first = children[key.value].start
                self.problems.append(
                    Mistake(
                        at,
                        f"key `{key.value}` is given twice; the first is on line {first.line}",
                        "remove one of the two",
                    )
                )
            else:
                children[key.value] = self.node(value, depth + 1, at)
        return children

    @staticmethod
    def _is_after_comma(key: yaml.Node, value: yaml.Node, number: yaml.Node) -> bool:
        """Return True if a decimal comma split a number in two: PyYAML reads the part after the
        comma as a key without a value.
        """
        return (
            isinstance(key, yaml.ScalarNode)
            and isinstance(number, yaml.ScalarNode)
            and bool(re.fullmatch(r"\d+( *[^\W\d].*)?", key.value, re.ASCII))
            and bool(re.fullmatch(r"[-+]?\d+", number.value, re.ASCII))
            and value.value == ""
            and value.start_mark.index == value.end_mark.index
        )

    def _position(self, node: yaml.Node) -> Position:
        return Position(self.source, node.start_mark.line + 1, node.start_mark.column + 1)


def _scalar_value(tag: str, text: str) -> str | int | float | bool | None:
    """Return the value of a scalar. Raises ValueError for a tag outside the core schema, or one
    that does not fit the text (`!!int x`).
    """
    kind = tag.removeprefix(TAG)
    if any("\ud800" <= character <= "\udfff" for character in text):
        raise ValueError(f"{text!r} contains an incomplete character (half of a surrogate pair)")
    if kind not in ("null", "bool", "int", "float", "str"):
        raise ValueError(f"the tag {tag.replace(TAG, '!!')} is not allowed in a spec")
    if kind != "str" and tag_of(text) != kind and not (kind == "float" and tag_of(text) == "int"):
        raise ValueError(f"{text!r} is not a valid {kind}")
    match kind:
        case "null":
            return None
        case "bool":
            return text.lower() == "true"
        case "int":
            return int(text, {"0o": 8, "0x": 16}.get(text[:2], 10))
        case "float":
            return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))
    return text
