"""A stranger's text in every field of every stored type: code has the same structure as with a
harmless one, in every language.
"""

import ast
import dataclasses
import io
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Literal, get_args, get_origin, get_type_hints
from xml.etree import ElementTree

import pytest
from export_samples import FORMULAS, STATIC, WITH_MEMORY
from jinja2 import Environment, nodes

from mapmore_cli.annexes.exporting import templates
from mapmore_cli.annexes.exporting.exports import exported
from mapmore_cli.domain.errors import DataError, MapmoreError
from mapmore_cli.domain.models import Formula
from mapmore_cli.domain.recording import Quantity, Signal

sys.path.insert(0, str(Path(__file__).parents[1] / "fuzz"))
from hostile_texts import tex_commands

HOSTILE = (
    "a\"; import os; os.mkdir('MARK') #",
    "a'''\n\"\"\"\nMARK = 1 */ int MARK; /* \\\n*\\\n/ ??/\n//",
    'a" onload="MARK"><MARK/><!-- & ]]> %\n\\input{MARK} $ ^^5cMARK} \\',
)
ALL = "".join(HOSTILE)
HARMLESS = "aq1"
LANGUAGES = (
    "c",
    "fmu",
    "fmu3",
    "py",
    "numpy",
    "matlab",
    "js",
    "tex",
    "mujoco",
    "simulink",
    "table",
)
MODELS = [
    dataclasses.replace(model, notes=("a note",))
    for model in (*STATIC.values(), *WITH_MEMORY.values(), *FORMULAS.values())
]
MODELS.append(
    dataclasses.replace(
        MODELS[0], signals=(Signal("strain", "rate", "pressure", 0.1, 2, 1.0, 1.0),)
    )
)
MODELS.append(
    dataclasses.replace(
        MODELS[0], signals=(Signal("strain", "direction", "pressure", None, None, 0.1, None),)
    )
)
FORMULA = next(model for model in MODELS if isinstance(model.body, Formula))
NOTED = dataclasses.replace(FORMULA.body.fit, notes=("a note",))
LEVELLED = tuple(dataclasses.replace(one, level=1.0) for one in FORMULA.body.ranges)
BODY = dataclasses.replace(FORMULA.body, fit=NOTED, level=FORMULA.inputs[0].name, ranges=LEVELLED)
MODELS.append(dataclasses.replace(FORMULA, body=BODY))
MODELS.sort(key=lambda model: len(repr(model)))  # the quickest first


def holds_text(hint):
    """Whether values of a type hold free texts, not those of other dataclasses."""
    if get_origin(hint) is Literal or dataclasses.is_dataclass(hint):
        return False
    return hint is str or any(map(holds_text, get_args(hint)))


def dataclasses_in(record):
    """The types of the dataclasses that a record is made of."""
    if dataclasses.is_dataclass(record):
        yield type(record)
        for one in dataclasses.fields(record):
            yield from dataclasses_in(getattr(record, one.name))
    elif isinstance(record, tuple | Mapping):
        for one in record.values() if isinstance(record, Mapping) else record:
            yield from dataclasses_in(one)


STORED = {
    kind: get_type_hints(kind)
    for kind in dict.fromkeys(kind for model in MODELS for kind in dataclasses_in(model))
}
FIELDS = [
    (kind, one.name)
    for kind, hints in STORED.items()
    for one in dataclasses.fields(kind)
    if holds_text(hints[one.name])
]


def changed(record, where, text, within=False):
    """A record with the text in the place of every text of a field."""
    if isinstance(record, str):
        return f"{record}{text}" if within else record
    if isinstance(record, tuple):
        return tuple(changed(one, where, text, within) for one in record)
    if isinstance(record, Mapping):
        return {
            changed(key, where, text, within): changed(one, where, text, within)
            for key, one in record.items()
        }
    if not dataclasses.is_dataclass(record):
        return record
    values = {
        one.name: changed(getattr(record, one.name), where, text, (type(record), one.name) == where)
        for one in dataclasses.fields(record)
    }
    return dataclasses.replace(record, **values)


def files_of(model):
    """What a model is exported to, by language and the ending of the file; a zip file is taken
    apart.
    """
    found = {}
    for to in LANGUAGES:
        try:
            files = exported(model, to, verify=False)
        except MapmoreError:
            continue
        for name, data in files.items():
            if name.endswith(".fmu"):
                with zipfile.ZipFile(io.BytesIO(data)) as archive:
                    files = {
                        one: archive.read(one)
                        for one in archive.namelist()
                        if not one.startswith("binaries/")
                    }
                found |= {
                    f"{to} {place} {one.rpartition('.')[2]}": text
                    for place, (one, text) in enumerate(files.items())
                }
                break
        else:
            found |= {
                f"{to} {place} {name.rpartition('.')[2]}": data
                for place, (name, data) in enumerate(files.items())
            }
    return found


C_TOKENS = re.compile(
    r'(?P<none>/\*.*?\*/|\s+|\\\n)|(?P<text>"(?:[^"\\\n]|\\.)*")|(?P<word>[A-Za-z_]\w*)'
    r"|(?P<other>\d[\w.+-]*|.)",
    re.DOTALL,
)


def structure(language, data):
    """What a reader of the language sees, without the words and the texts."""
    text = data.decode() if language != "mat" else ""
    match language:
        case "py":
            tree = ast.parse(text)
            return [(type(node).__name__, getattr(node, "attr", None)) for node in ast.walk(tree)]
        case "c" | "h":
            assert "??" not in text
            return [
                one.lastgroup if one["other"] is None else one[0]
                for one in C_TOKENS.finditer(text)
                if one["none"] is None
            ]
        case "xml":
            return [(one.tag, sorted(one.attrib)) for one in ElementTree.fromstring(text).iter()]
        case "tex":
            kept = {name for name in tex_commands(text) if name not in WRITTEN}
            return kept, text.count("\\[")
        case "csv":
            return len(text.splitlines())
        case "m":
            return re.sub(r"[A-Za-z_]\w*", "w", re.sub(r"%.*", "%", text))
        case "mjs":
            text = re.sub(r"/\*.*?\*/|^//.*?$", "", text, flags=re.DOTALL | re.MULTILINE)
            return re.sub(r"[A-Za-z_]\w*", "w", re.sub(r'"(?:[^"\\\n]|\\.)*"', '""', text))
        case "mo":
            return re.sub(r"[A-Za-z_]\w*", "w", re.sub(r'"(?:[^"\\\n]|\\.)*"', '""', text))
        case "txt":
            return re.sub(r"double \w+\(", "double (", re.sub(r"# .*", "#", text))
    return None


WRITTEN = {*tex_commands("".join(templates.tex_text(chr(code)) for code in range(0x400)))}


def compiles(files, folder):
    """Check the syntax of the C of a model, with trigraphs."""
    sources = [data for key, data in files.items() if key.startswith("c ")]
    name = re.search(rb'#include "(\w+)\.h"', sources[1])
    (folder / f"{name[1].decode()}.h").write_bytes(sources[0])
    (folder / "source.c").write_bytes(sources[1])
    line = [
        "gcc",
        "-fsyntax-only",
        "-std=c99",
        "-trigraphs",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-Wno-unused-function",
        "source.c",
    ]
    subprocess.run(line, cwd=folder, check=True)


@pytest.mark.parametrize("where", FIELDS, ids=lambda where: f"{where[0].__name__}.{where[1]}")
def test_a_text_is_no_code(where, tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "/bin/false")
    model = next(model for model in MODELS if repr(changed(model, where, HARMLESS)) != repr(model))
    try:
        harmless = files_of(changed(model, where, HARMLESS))
    except Exception as error:  # the field is no free text: such a model is refused when it is read
        harmless = {}
        refused = (type(error), MapmoreError, ValueError, KeyError)
    else:
        refused = (MapmoreError, ValueError)
    try:
        found = files_of(changed(model, where, ALL))
    except refused:
        return
    for key, data in found.items():
        language = key.rpartition(" ")[2]
        if key in harmless:
            assert structure(language, data) == structure(language, harmless[key]), key
        assert key in harmless or b"MARK" not in data
    if shutil.which("gcc") and "c 0 h" in found:
        compiles(found, tmp_path)


def test_there_are_models_with_every_field():
    """Else the test above would look at nothing."""
    missing = [
        f"{type_.__name__}.{name}"
        for type_, name in FIELDS
        if all(repr(changed(m, (type_, name), "q")) == repr(m) for m in MODELS)
    ]
    assert missing == []


def test_names_of_a_program_are_identifiers():
    """`store` refuses such a model when it is read; here it is one that was never stored."""
    model = next(one for one in MODELS if len(one.inputs) == 2)
    with pytest.raises(DataError, match="cannot be a name in code"):
        templates.word('f"; import os #')
    with pytest.raises(DataError, match="cannot be a name in code"):
        templates.code("int {};", "f(void) { abort(); } int g")
    assert templates.code("int {};", templates.identifier(model.name)).startswith("int ")


SOURCES = Path(templates.__file__).parent / "sources"
TEMPLATES = sorted(SOURCES.rglob("*.jinja"))
INSIDE = {
    "c": r"/\*.*?\*/",
    "h": r"/\*.*?\*/",
    "m": r"^%.*?$",
    "mjs": r"/\*\*.*?\*/|^//.*?$",
    **dict.fromkeys(("mo", "sh"), r"(?!)"),
    "py": r'""".*?"""',
    "tex": r"^%.*?$",
    "xml": r"(?!)",
}


@pytest.mark.parametrize("template", TEMPLATES, ids=lambda path: path.name)
def test_notes_stand_in_comments_alone(template):
    """Only there is their alphabet harmless."""
    language = template.name.split(".")[-2]
    bare = re.sub(INSIDE[language], "", template.read_text(), flags=re.DOTALL | re.MULTILINE)
    assert not re.search(r"\|\s*(note|unit)\b|map\(\"unit\"\)", bare)
    filters = {one.name for one in Environment().parse(template.read_text()).find_all(nodes.Filter)}
    known = {"note", "unit", "word", "listed", "map", "join", "upper", "length", "list"}
    assert filters <= known
    assert template.name.split(".")[-2] in templates.LITERALS


def texts(language):
    written = templates.templates(language).from_string(
        "{{ a }}|{{ b }}|{{ 'c' }}|{{ d }}|{{ [a, a] | listed }}"
    )
    for text in HOSTILE:
        yield written.render(a=text, b=templates.word("b"), d=1.5)


@pytest.mark.parametrize("language", templates.LITERALS)
def test_what_is_put_into_a_template_is_a_literal(language):
    for hostile, found in zip(HOSTILE, texts(language), strict=True):
        literal = templates.LITERALS[language](hostile)
        assert found == f"{literal}|b|{templates.LITERALS[language]('c')}|1.5|{literal}, {literal}"
    with pytest.raises(TypeError, match="neither a text nor a number"):
        templates.templates(language).from_string("{{ a }}").render(a=None)
    with pytest.raises(TypeError, match="neither a text nor a number"):
        templates.templates(language).from_string("{{ a }}").render()


def test_strings_in_c_are_what_a_compiler_reads(tmp_path):
    if shutil.which("gcc") is None:
        pytest.skip("there is no C compiler here")
    text = "".join(map(chr, range(1, 0x180))) + "??/ %s \\ 7"
    code = (
        f"#include <stdio.h>\nint main(void) {{ fputs({templates.LITERALS['c'](text)}, stdout); "
        f"return 0; }}\n"
    )
    (tmp_path / "s.c").write_text(code)
    subprocess.run(
        ["gcc", "-std=c99", "-trigraphs", "-Wall", "-Werror", "s.c", "-o", "s"],
        cwd=tmp_path,
        check=True,
    )
    assert subprocess.run([tmp_path / "s"], capture_output=True, check=True).stdout.decode() == text


def test_quantities_alone():
    """An output's name was the text between two quotes of a module, and ran when it was
    compared.
    """
    model = next(one for one in MODELS if not one.memories)
    evil = 'f"; __builtins__["__import__"]("os").mkdir("MARK") #'
    for to in ("py", "numpy"):
        (text,) = exported(dataclasses.replace(model, output=Quantity(evil, "N")), to).values()
        (output,) = [
            one
            for one in ast.parse(text).body
            if isinstance(one, ast.Assign) and one.targets[0].id == "OUTPUT"
        ]
        assert ast.literal_eval(output.value) == evil
    assert not Path("MARK").exists()
