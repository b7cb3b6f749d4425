"""Read and write YAML with the scalars of YAML 1.2's core schema, and expand `${VAR}`.

Plain PyYAML follows YAML 1.1, in which `1e-3` is text, `no` is false, `010` is eight and `1:30` is
ninety.
"""

from __future__ import annotations

import gc
import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, NoReturn, TypeVar, cast

import yaml

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.study.diagnostics import Mistake, fail
from mapmore_cli.study.tree import Node, Position, SourceText

V = TypeVar("V")

_TAG = "tag:yaml.org,2002:"
_SCALARS = {
    "null": r"~|null|Null|NULL|",
    "bool": r"true|True|TRUE|false|False|FALSE",
    "int": r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+",
    "float": r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?"
    r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)",
}
_RESOLVERS = {
    None: [
        (_TAG + tag, re.compile(f"(?:{pattern})\\Z", re.ASCII)) for tag, pattern in _SCALARS.items()
    ]
}
"""Table by which PyYAML finds the type of an unquoted scalar: tags with patterns, which it tries in
this order. The key None means any first character.
"""

DEEPEST = 40
"""Largest depth of nesting that is read; a spec needs ten."""


class CoreLoader(yaml.SafeLoader):
    """Loader that composes nodes with the tags of YAML 1.2's core schema; `<<` is an ordinary
    key.
    """

    yaml_implicit_resolvers = _RESOLVERS
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


_BOOLEANS_OF_1_1 = frozenset({"y", "n", "yes", "no", "on", "off"})


ONE_LINE = 80
"""Largest number of characters of a list or mapping that is written on one line."""


def _on_one_line(node: yaml.Node) -> int:
    """Mark short lists and mappings to be written on one line, and return the approximate number of
    characters of a node.
    """
    if not isinstance(node, yaml.CollectionNode):
        return ONE_LINE if "\n" in node.value else len(node.value) + 2
    parts = [part for part in node.value for part in (part if isinstance(part, tuple) else (part,))]
    size = 2 + sum(map(_on_one_line, parts))
    # `polynomial: {...}` as an item of a list needs no braces of its own
    is_wrapped = len(parts) == 2 and isinstance(parts[1], yaml.CollectionNode)
    node.flow_style = size <= ONE_LINE and not is_wrapped
    return size


class _CoreDumper(yaml.SafeDumper):
    """Dumper that quotes every text that `CoreLoader` would read as something else, and writes no
    anchors.
    """

    yaml_implicit_resolvers = _RESOLVERS

    def ignore_aliases(self, _data: object) -> bool:
        return True

    def serialize(self, node: yaml.Node) -> None:
        """Write short nodes on one line, but never the whole document."""
        _on_one_line(node)
        if isinstance(node, yaml.CollectionNode):
            node.flow_style = False
        super().serialize(node)

    def represent_str(self, data: str) -> yaml.ScalarNode:
        """Escape the line breaks that exist in Unicode only; PyYAML would write them unescaped and
        read them back as spaces.

        Words that a reader of YAML 1.1 takes for true or false, for example the key `on`, are
        quoted as well.
        """
        style = (
            '"'
            if any(char in data for char in "\x85\u2028\u2029") or data.lower() in _BOOLEANS_OF_1_1
            else None
        )
        return self.represent_scalar(f"{_TAG}str", data, style)


_CoreDumper.add_representer(str, _CoreDumper.represent_str)


def tag_of(text: str) -> str:
    """Return the core-schema type of an unquoted scalar: `null`, `bool`, `int`, `float` or
    `str`.
    """
    tags = (tag.removeprefix(_TAG) for tag, pattern in _RESOLVERS[None] if pattern.match(text))
    return next(tags, "str")


@dataclass(frozen=True)
class _Part:
    """A value that is compared by its Python spelling, so that `1`, `1.0` and `True` are
    different.
    """

    written: str
    value: object = field(compare=False)


def dump(value: object) -> str:
    """Return YAML text from which `CoreLoader` reads the same value.

    The keys of a document are written one by one and cached: the specs of a campaign differ in few
    keys, and writing YAML is slower than reading it.
    """
    parts: list[object] = (
        [{key: member} for key, member in value.items()] if isinstance(value, dict) else []
    )
    return "".join(_dumped(_Part(repr(part), part)) for part in parts or [value])


@lru_cache(maxsize=256)
def _dumped(part: _Part) -> str:
    text: str = yaml.dump(
        part.value, Dumper=_CoreDumper, sort_keys=False, allow_unicode=True, width=120
    )
    return text


def as_overrides(settings: Mapping[str, Any]) -> tuple[str, ...]:
    """Return settings by key path (`{"fit.max_terms": 2}`) in the form that `--set` takes."""
    return tuple(
        f"{key}={json.dumps(escaped(value), ensure_ascii=False)}" for key, value in settings.items()
    )


# Variables
# --------------------------------------------------------------------------------------------------

READABLE = "MAPMORE_"
"""Prefix of the environment variables that any spec may read. The prefix protects all others: a
spec from a stranger must not be able to read a password.
"""

MORE = "MAPMORE_ENV"
"""Name of the variable that lists further variables, separated by commas. `--env` adds to it, so
that worker processes know them too.
"""

VARIABLES = "set it, give a default as `${NAME:-default}`, or write `$${` for a plain `${`"
"""Remedy in the message about a variable that cannot be expanded."""

_REFERENCE = re.compile(r"\$\$\{|\$\{([^{}]*)(\}?)")
_BODY = re.compile(r"([A-Za-z_][A-Za-z0-9_]*)(:-(.*))?", re.DOTALL)


def expand(text: str) -> str:
    """Return the text with every reference replaced; `$${` becomes `${`.

    As in a shell, the default after `:-` replaces an unset or empty variable.

    Raises ValueError for a variable that is not set and has no default, a variable that no spec may
    read, and a malformed reference.
    """
    return _REFERENCE.sub(_variable_value, text)


def readable_variables() -> dict[str, str]:
    """Return the environment variables that specs may read, with their values."""
    more = os.environ.get(MORE, "").split(",")
    return {
        name: value
        for name, value in os.environ.items()
        if name.startswith(READABLE) or name in more
    }


def variable_in(text: str) -> str | None:
    """Return the first variable reference in a text, as it is written; None if there is none."""
    return next((match[0] for match in _REFERENCE.finditer(text) if match[0] != "$${"), None)


def escaped(value: V) -> V:
    """Return a value in which all texts are escaped, so that `expand` returns the original
    texts.
    """
    changed: object = value
    if isinstance(value, dict):
        changed = {key: escaped(item) for key, item in value.items()}
    elif isinstance(value, list):
        changed = [escaped(item) for item in value]
    elif isinstance(value, str):
        changed = value.replace("${", "$${")
    return cast(V, changed)


def _variable_value(reference: re.Match[str]) -> str:
    if reference[0] == "$${":
        return "${"
    body = _BODY.fullmatch(reference[1])
    if body is None or not reference[2]:
        raise ValueError(f"`{reference[0]}` is not of the form `${{NAME}}` or `${{NAME:-default}}`")
    name, has_default, default = body.groups()
    if not name.startswith(READABLE) and name not in os.environ.get(MORE, "").split(","):
        raise ValueError(
            f"the environment variable {name} is not read: its name does not begin with "
            f"{READABLE}, and it was not allowed by `--env {name}`"
        )
    value = os.environ.get(name)
    if has_default and not value:
        return default or ""
    if value is None:
        raise ValueError(f"the environment variable {name} is not set")
    return value


# Reading
# --------------------------------------------------------------------------------------------------

# largest size of a file in bytes; it is enough for a campaign of a hundred thousand runs
LARGEST = 5_000_000
KEPT = 100_000  # largest number of characters of a text that is cached
# largest number of values that aliases may repeat; nine levels of nine aliases would make 4e8
_MOST_VALUES = 50_000

_PLAINER = (  # for each message of PyYAML, its meaning in plain words and the remedy
    (
        "cannot start any token",
        "a character that is not allowed here",
        "quote the text, and indent with spaces instead of tabs",
    ),
    (
        "mapping values are not allowed here",
        "a `:` that is not allowed here",
        "put a text that contains `: ` in quotes, or correct the indentation",
    ),
    ("could not find expected ':'", "a key without `:`", "write `key: value`"),
    (
        "expected <block end>",
        "the indentation does not match the lines above, or a bracket is missing",
        "align the keys of one mapping",
    ),
    ("expected ',' or", "a `,` or a closing bracket is missing", "close every `[` and `{`"),
    (
        "but found another document",
        "a second document starts here",
        "one file holds one spec: remove the `---`",
    ),
    (
        "found undefined alias",
        "an alias without its anchor",
        "define it above with `&name`, or quote a text that begins with `*`",
    ),
    (
        "found duplicate anchor",
        "an anchor that is defined twice",
        "give the second one another name",
    ),
    (
        "levels deep",
        f"nested more than {DEEPEST} levels deep",
        "reduce the nesting; a spec needs ten levels",
    ),
    ("found unexpected end of stream", "the text ends within quotes", "close the quotes"),
)


@contextmanager
def files_read() -> Iterator[list[Path]]:
    """Collect the paths of the files that are read as specs within the context."""
    paths = list[Path]()
    token = _READ.set(paths)
    try:
        yield paths
    finally:
        _READ.reset(token)


_READ: ContextVar[list[Path] | None] = ContextVar("_READ", default=None)


def read_source(path: Path) -> SourceText:
    """Return the text of a file.

    Raises SpecError for a file that is missing, unreadable, larger than a spec can be, or not in
    UTF-8.
    """
    if (paths := _READ.get()) is not None:
        paths.append(path)
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
    """Return the tree of a YAML text; a duplicate key is added to `problems`.

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
        _explain_fault(error, source)
    except (ValueError, OverflowError):  # `chr` raises these errors inside PyYAML
        escape = re.search(r"\\U(?!00(?:0|10))[0-9A-Fa-f]{8}", source.text)
        fault = f"{(escape[0] if escape else 'an escape')} is not a Unicode character"
        fail(_at(source, escape.start() if escape else 0), fault, "write the character itself")
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
    kind = tag.removeprefix(_TAG)
    if any("\ud800" <= character <= "\udfff" for character in text):
        raise ValueError(f"{text!r} contains an incomplete character (half of a surrogate pair)")
    if kind not in ("null", "bool", "int", "float", "str"):
        raise ValueError(f"the tag {tag.replace(_TAG, '!!')} is not allowed in a spec")
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


def _at(source: SourceText, offset: int) -> Position:
    before = source.text[:offset]
    return Position(source, before.count("\n") + 1, len(before) - before.rfind("\n"))


_MARKS = (" #", "[", "]", "{", ": ")
_BEGIN = r"[^\s'\"\[{&*!|>]|\[[^\]]*\][ \t]*(?=\w)"
_VALUE = re.compile(
    rf"[\w'\"<]:[ \t]+(?P<text>(?:{_BEGIN})(?:\[[^\]]*\]?|[^,{{}}\[]|\{{[^}}]*\}})*)"
)
"""Pattern of an unquoted value after its key, including the brackets in it."""


def _unquoted_text(lines: Iterable[str]) -> str | None:
    """Return the first value in some lines that must be quoted because it contains a special
    character, for example `P [kPa]`; None if there is none.
    """
    texts = (match["text"].strip() for line in lines for match in _VALUE.finditer(line))
    return next((text for text in texts if any(mark in text for mark in _MARKS)), None)


def _explain_fault(error: Exception, source: SourceText) -> NoReturn:
    """Raise a SpecError that states PyYAML's complaint in plainer words, with its place."""
    if isinstance(error, yaml.reader.ReaderError):
        at = _at(source, error.position)
        fail(
            at,
            f"control character #x{int(error.character):04x}",
            "give the path of a spec, which is plain text; this seems to be a data file",
        )
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    at = Position(source, mark.line + 1, mark.column + 1) if mark else Position(source, 1, 1)
    complaint = (
        f"{getattr(error, 'context', None) or ''} {getattr(error, 'problem', None) or ''}".strip()
    )
    context = getattr(error, "context_mark", None)
    begin, end = (context or mark).line if mark else 0, at.line
    if (text := _unquoted_text(source.text.splitlines()[begin:end])) is not None:
        marks = next(mark for mark in _MARKS if mark in text)
        fail(
            at,
            f"not valid YAML: `{text}` has `{marks.strip()}` in it, which means something in YAML",
            f"put it in quotes: `{json.dumps(text, ensure_ascii=False)}`",
        )
    for phrase, message, remedy in _PLAINER:
        if phrase in complaint:
            fail(at, f"not valid YAML: {message}", remedy)
    fail(at, f"not valid YAML: {complaint}")
