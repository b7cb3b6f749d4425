"""Texts of strangers within other languages, as the languages' own readers take them: gcc, Python's
parser, an XML parser.
"""

import ast
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree
from xml.sax.saxutils import escape

import numpy as np
import pytest
from common import needs_node
from export_samples import formula
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmore_cli.annexes.exporting import verifying
from mapmore_cli.annexes.exporting.exports import exported
from mapmore_cli.annexes.exporting.words import identifiers
from mapmore_cli.annexes.sums import Part, Sum
from mapmore_cli.domain import foreign
from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Quantity

sys.path.insert(0, str(Path(__file__).parents[1] / "fuzz"))
from hostile_texts import COMMANDS, ESCAPES, tex_commands

TEXTS = st.lists(st.sampled_from([*ESCAPES, *COMMANDS]) | st.text(max_size=4), max_size=6).map(
    "".join
)
NAMES = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,3}", fullmatch=True)
needs_compiler = pytest.mark.skipif(
    shutil.which("gcc") is None, reason="there is no C compiler here"
)


@needs_compiler
@settings(max_examples=4)
@given(st.lists(TEXTS, min_size=40, max_size=60))
def test_notes_in_comments_for_the_c_preprocessor(notes):
    source = "\n".join(f"/* {foreign.plain(one)} */ int after{i};" for i, one in enumerate(notes))
    options = ["-E", "-P", "-trigraphs", "-std=c99", "-Wall", "-Wextra", "-Werror", "-xc", "-"]
    read = subprocess.run(
        ["gcc", *options], input=source.encode(), capture_output=True, check=True
    ).stdout.decode()
    assert read.split() == " ".join(f"int after{i};" for i in range(len(notes))).split()


@given(TEXTS)
def test_notes_in_docstrings_for_python(note):
    doc, after = ast.parse(f'"""{foreign.plain(note)}"""\nafter = 1\n').body
    assert isinstance(doc.value, ast.Constant)
    assert isinstance(after, ast.Assign)


@given(TEXTS)
def test_text_for_xml_and_tex(text):
    element = ElementTree.fromstring(f"<a>{escape(foreign.xml_text(text))}</a>")
    assert element.text in (foreign.xml_text(text), None)
    assert list(tex_commands("".join(foreign.tex_comment(text)))) == []
    known = {*tex_commands("".join(foreign._TEX.values()))}
    assert {*tex_commands(foreign.tex_text(text))} <= known
    assert {*tex_commands(foreign.tex_label(text))} <= {
        *known,
        *foreign._FORMULA_COMMANDS.split(),
        *",;: ",
    }


def test_labels_in_tex_keep_formulas_and_nothing_else():
    assert foreign.tex_label("$a_{1}$, $b_{1$, $}{$") == r"$a_{1}$, \$b\_\{1\$, \$\}\{\$"
    assert foreign.tex_label(r"Force $F_\mathrm{x}$ (N)") == r"Force $F_\mathrm{x}$ (N)"
    assert (
        foreign.tex_label(r"\$\input{a}\$ $F$")
        == r"\textbackslash{}\$\textbackslash{}input\{a\}\textbackslash{}\$ $F$"
    )
    for hostile in ("$^^5cinput{a}$", r"$\input{a}$", "$}{$", "$%$", "$#$"):
        assert "$" not in foreign.tex_label(hostile).replace(r"\$", "")


@given(st.lists(NAMES, max_size=8))
def test_identifiers_differ_even_without_regard_to_case(names):
    found = identifiers(names, ["p", "_beyond"])
    assert len({name.lower() for name in found}) == len(names)
    assert all(name.isidentifier() and name.lower() not in {"p", "_beyond"} for name in found)
    compile(f"def f({', '.join(found)}): pass", "f", "exec")
    assert identifiers(["pressure", "p1", "P2"]) == ["pressure", "p1", "P2"]


def hostile(model, mark, names):
    """The model with commands in each free text, and its inputs called otherwise."""
    commands = [
        f'"""\nimport os; os.mkdir("{mark}")\n"""',
        "x*\\\n/ int mkdir(const char *, unsigned); __attribute__((constructor)) void "
        f'f(void) {{ mkdir("{mark}", 511); }} /*',
        f"x\n\\immediate\\write18{{mkdir {mark}}}",
    ]
    text = "".join(commands)
    inputs = tuple(Quantity(names.get(one.name, one.name), text) for one in model.inputs)
    return Model(
        f"x {text}",
        Quantity("outside_range", text),
        inputs,
        Sum((Part(model, 1.0, names),)),
        notes=(text,),
    )


@needs_compiler
@pytest.mark.parametrize(
    "names",
    [
        ("p", "P"),
        ("lambda", "np"),
        ("x_s", "s"),
        ("double", "DOUBLE"),
        ("curve_1", "finite"),
        ("__debug__", "in"),
    ],
)
def test_names_and_texts_of_a_stranger_are_names_and_texts(names, tmp_path):
    model = hostile(
        formula("sarosi"), tmp_path / "mark", dict(zip(("pressure", "strain"), names, strict=True))
    )
    for to in ("c", "fmu", "py", "tex"):
        for name, data in exported(model, to).items():  # compiled, imported and compared
            (tmp_path / name).write_bytes(data)
    source = next(iter(tmp_path.glob("*.tex"))).read_text()
    known = {
        *tex_commands(exported(formula("sarosi"), "tex").popitem()[1].decode()),
        *["text", "mathit", "_", "textbackslash", "textasciicircum"],
    }
    assert {*tex_commands(source)} <= known
    assert not (tmp_path / "mark").exists()


@needs_compiler
@pytest.mark.parametrize("to", ["c", "fmu", "py", pytest.param("js", marks=needs_node)])
def test_code_that_is_not_the_model_is_not_written(to, monkeypatch):
    model = formula("sarosi")
    run = verifying.simulate(model, verifying.points(model))
    monkeypatch.setattr(
        verifying,
        "simulate",
        lambda *_: replace(run, values=np.where(np.arange(100) == 50, 7.0, run.values)),
    )
    with pytest.raises(MapmoreError, match="gives other values than the model, so it is not"):
        exported(model, to)
    assert exported(model, to, verify=False)
