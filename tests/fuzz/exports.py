"""Random models with hostile names, units and notes in every language; and free texts through every
format of tables and figures.
"""

import csv
import dataclasses
import io
import logging
import os
import re
import shutil
import sys
import zipfile
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

from driver import Fault, Target, refused
from hostile_texts import tex_commands, text_of

from mapmore_cli.annexes.exporting import verifying
from mapmore_cli.annexes.exporting.exports import exported
from mapmore_cli.annexes.motion.body import MotionSection
from mapmore_cli.annexes.sums import Part, Sum
from mapmore_cli.domain import foreign
from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.domain.models import CurveFunction, Formula, Model, SegmentFunction
from mapmore_cli.domain.recording import CurveRange, Quantity, Signal
from mapmore_cli.reporting.table import Column, Table, to_csv, to_html, to_latex, to_markdown
from mapmore_cli.study.units import base_units

sys.path.insert(0, str(Path(__file__).parents[1] / "exporting"))

NAMES = (
    *(
        "p",
        "P",
        "p_2",
        "P_2",
        "s",
        "S",
        "x_p",
        "x_x_p",
        "np",
        "lambda",
        "in",
        "out",
        "bits",
        "value",
        "results",
        "finite",
        "float",
    ),
    *(
        "double",
        "def",
        "True",
        "None",
        "__debug__",
        "_",
        "__",
        "_beyond",
        "beyond",
        "end_at",
        "sign_of",
        "outside_range",
        "OUTSIDE_RANGE",
    ),
    *(
        "real",
        "main",
        "exp",
        "log2",
        "power1",
        "inverse1",
        "term_1",
        "curve_1",
        "held_1",
        "at_p_1",
        "INPUTS",
        "inputs",
        "measured",
    ),
    *(
        "state",
        "print",
        "self",
        "State",
        "step",
        "evaluate",
        "reset",
        "linux",
        "unix",
        "errno",
        "isfinite",
        "fabs",
        "p" * 300,
    ),
    *("force_measured", "double", "time", "NULL", "model", "NAN", "I", "auto"),
)
MODELS = (
    "int",
    "model",
    "MODEL",
    "co-simulation",
    "numpy",
    "math",
    "stdio",
    "20 mm",
    "con",
    "class",
    "x",
    "a" * 300,
    "Übung 1",
    "p",
    "os",
)
SAID = re.compile(r"\b(pressure|strain|speed|force|angle)\b")
TEXTS = {
    Quantity: ("unit",),
    CurveFunction: ("curve",),
    CurveRange: ("curve",),
    SegmentFunction: ("id",),
    MotionSection: ("id",),
}


def renamed(record, names, chance, mark):
    """A part of a model with other names of quantities in all of its texts, and hostile texts where
    they are free.
    """
    match record:
        case str():
            return SAID.sub(lambda found: names.get(found[0], found[0]), record)
        case tuple():
            return tuple(renamed(one, names, chance, mark) for one in record)
        case dict():
            return {
                renamed(key, names, chance, mark): renamed(one, names, chance, mark)
                for key, one in record.items()
            }
    if not dataclasses.is_dataclass(record) or isinstance(record, type):
        return record
    values = {
        one.name: renamed(getattr(record, one.name), names, chance, mark)
        for one in dataclasses.fields(record)
    }
    values |= {name: text_of(chance, mark) for name in TEXTS.get(type(record), ())}
    return dataclasses.replace(record, **values)


@cache
def bodies():
    from export_samples import FORMULAS, STATIC, WITH_MEMORY, formula, memory, pieces

    small = (
        pieces(levels=(100.0, 300.0), counts={"strain": 1}, terms=("1", "strain*exp(strain)")),
        pieces(levels=None, counts={"strain": 2}, terms=("strain^2", "abs(strain)")),
        formula("sarosi"),
        formula("reynolds"),
        memory(("pressure", "strain[k-1]"), ("pressure", "strain[k-1]^2")),
        memory(("force[k-1]", "pressure"), ("force[k-1]", "pressure")),
    )
    return (
        *small * 30,
        *STATIC.values(),
        *FORMULAS.values(),
        *(model for name, model in WITH_MEMORY.items() if name != "diverging"),
    )


def model_of(chance, mark):
    """A model of some kind, with hostile names and texts."""
    model = chance.choice(bodies())
    others = chance.sample(sorted({*NAMES}), 5)
    names = dict(zip(("pressure", "strain", "speed", "force", "angle"), others, strict=True))
    # a formula knows its inputs by name
    if isinstance(model.body, Formula | Sum) or model.backbone is not None:
        inputs = tuple(
            Quantity(names.get(one.name, f"own_{one.name}"), text_of(chance, mark))
            for one in model.inputs
        )
        parts = {one.name: other.name for one, other in zip(model.inputs, inputs, strict=True)}
        if any(memory for memory in model.memories):
            return dataclasses.replace(
                model, name=text_of(chance, mark) + "a", notes=(text_of(chance, mark),)
            )
        model = Model(
            "",
            Quantity(names["force"], text_of(chance, mark)),
            inputs,
            Sum((Part(model, 1.0, parts),)),
        )
    else:
        model = renamed(model, names, chance, mark)
    name = (
        chance.choice(MODELS)
        if chance.random() < 0.5
        else text_of(chance, mark) + chance.choice(["a", "1", "x"])
    )
    signals = (
        (Signal(model.inputs[0].name, "rate", text_of(chance, mark), 0.1, 2, 1.0, 1.0),)
        if model.inputs
        else ()
    )
    return dataclasses.replace(model, name=name, notes=(text_of(chance, mark),), signals=signals)


PLAIN_FLAGS = ("-std=c99", "-ffp-contract=off")
FLAGS = {"tcc": PLAIN_FLAGS, "cc": (*PLAIN_FLAGS, "-O0", "-trigraphs")}
TEX = {
    "noindent",
    "left",
    "right",
    "mathrm",
    "mathit",
    "text",
    "frac",
    "sqrt",
    "ln",
    "operatorname",
    "cdot",
    "begin",
    "end",
    "quad",
}


def try_model(chance, number, folder):
    """Export to every language; the code is compiled or imported and compared with `predict`, and
    nothing of the texts runs.

    TinyCC, where there is one, compiles 49 models of 50, in a twentieth of the time; the others
    have the compiler that users have.
    """
    mark = folder / f"mark{number}"
    by = "tcc" if number % 50 and shutil.which("tcc") else "cc"
    os.environ["CC"], verifying.FLAGS = by, FLAGS[by]
    model = model_of(chance, str(mark))
    try:
        for to in ("py", "tex", "c", "fmu"):
            files = exported(model, to, single=to == "c" and number % 7 == 0)
            for name in files:
                if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*\.[a-z]+", name):
                    raise Fault(f"the file {name!r}")
            if to == "tex" and (
                strange := {*tex_commands(*map(bytes.decode, files.values()))}
                - TEX
                - tex_of_terms()
                - {*ESCAPED}
            ):
                raise Fault(f"TeX obeys {strange}")
            if to == "fmu":
                _unit(*files.values())
    except MapmoreError as error:
        if error.exit_code == 1:
            raise
        return refused(error)
    finally:
        if mark.exists():
            raise Fault("a text ran")
    return f"compared ({by})"


def _unit(data):
    """Fault where the description of a unit is no XML, or two of its variables have one name."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        names = [
            one.get("name")
            for one in ElementTree.fromstring(archive.read("modelDescription.xml")).iter(
                "ScalarVariable"
            )
        ]
        if len({*names}) < len(names):
            raise Fault(f"variables {names}")
        if not any(name.startswith("binaries/") for name in archive.namelist()):
            raise Fault("a unit without a binary")


ESCAPED = frozenset(tex_commands("".join(foreign._TEX.values())))


@cache
def tex_of_terms():
    """The commands in the equations of models whose texts are plain."""
    return frozenset(
        name
        for model in {id(one): one for one in bodies()}.values()
        for data in _told(model)
        for name in tex_commands(data.decode())
    )


def _told(model):
    try:
        return [*exported(model, "tex").values()]
    except MapmoreError:
        return []


class Tags(HTMLParser):
    def __init__(self):
        super().__init__()
        self.found = set()

    def handle_starttag(self, tag, attrs):
        self.found |= {tag, *(name for name, _ in attrs)}


def try_text(chance, number, folder):
    """A table and a figure in which every text is free, in every format, as the formats' own
    readers take them.
    """
    # no lone surrogates
    title, heading, cell, note = (
        text_of(chance).encode(errors="ignore").decode() for _ in range(4)
    )
    table = Table(
        "t", title, (Column(heading, cell), Column("n")), ((cell, 1.0), (note, 2.0)), (note,)
    )
    tags = Tags()
    tags.feed(to_html(table))
    if strange := tags.found - {
        "table",
        "caption",
        "thead",
        "tbody",
        "tr",
        "th",
        "td",
        "wbr",
        "span",
        "scope",
        "class",
        "data-name",
    }:
        raise Fault(f"HTML has {strange}")
    read = list(csv.reader(io.StringIO(to_csv(table), newline="")))
    if [len(line) for line in read] != [2, 2, 2] or any(
        cell.lstrip()[:1] in (*"=+-@",) for line in read for cell in line
    ):
        raise Fault(f"CSV reads as {read}")
    if (
        strange := {*tex_commands(to_latex(table))}
        - ESCAPED
        - {"begin", "end", "toprule", "midrule", "bottomrule", "\\"}
    ):
        raise Fault(f"TeX obeys {strange}")
    if len(to_markdown(table).partition("\n| ")[2].splitlines()) < 4:
        raise Fault("Markdown lost a row")
    _figure(title, heading, cell, number % 2 == 0)
    return "read back"


def _figure(title, label, entry, maths):
    """Fault where a figure is no XML, or TeX obeys more of it than of one whose texts are plain."""
    from mapmore_cli.reporting.figures.drawing import to_svg
    from mapmore_cli.reporting.figures.style import figure_style, wrong_formula
    from mapmore_cli.reporting.pgf import to_pgf

    with figure_style():
        ElementTree.fromstring(to_svg(_drawn(title, label, entry, False), "a", title))
        source = to_pgf(_drawn(title, label, entry, maths and wrong_formula(label) is None))
    if strange := {*tex_commands(source)} - {
        *ESCAPED,
        *tex_of_figures(),
        *foreign._FORMULA_COMMANDS.split(),
        *",;: ",
    }:
        raise Fault(f"TeX obeys {strange} in a figure")


def _drawn(title, label, entry, maths):
    from matplotlib.figure import Figure

    figure = Figure(figsize=(2, 2))
    axes = figure.add_axes((0.3, 0.3, 0.6, 0.6), xticks=[], yticks=[])
    axes.set_title(title, parse_math=False)
    axes.set_xlabel(label, parse_math=maths)
    figure.text(0, 0, entry, parse_math=False)
    return figure


@cache
def tex_of_figures():
    from mapmore_cli.reporting.pgf import to_pgf

    return frozenset(tex_commands(to_pgf(_drawn("a", "b", "c", False))))


def _warm(_folder):
    logging.disable()  # fonts lack glyphs
    bodies(), tex_of_terms(), tex_of_figures(), base_units("kPa")


EXPORTS = Target(
    "exports",
    try_model,
    past=("compared (tcc)", "compared (cc)"),
    longest=60,
    warm=_warm,
)
FREE_TEXTS = Target(
    "texts",
    try_text,
    past=("read back",),
    warm=_warm,
)
