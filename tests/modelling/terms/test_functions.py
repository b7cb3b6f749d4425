"""Every function of expressions in every language: the same numbers as NumPy's, and its slope."""

import shutil
import subprocess
import sys
from xml.etree.ElementTree import fromstring

import numpy as np
import pytest
from common import NO_OCTAVE, OCTAVE
from matplotlib.mathtext import MathTextParser

from mapmore_cli.annexes.exporting.templates import source
from mapmore_cli.modelling.expressions import derivative, evaluate, parse
from mapmore_cli.modelling.expressions.functions import FUNCTIONS

PLACES = np.array(
    [-np.inf, -800, -30, -2.5, -1, -0.5, -1e-9, 0, 1e-9, 0.3, 1, 2.5, 30, 800, np.inf, np.nan]
)


def c(real, suffix):
    """A program in C that prints every function at every place, one a line."""
    lines = "".join(
        f"{real} {name}_here({real} x) {{ return ({real})({_called(name, 'c', suffix)}); }}\n"
        for name in FUNCTIONS
    )
    each = ", ".join(f"{name}_here" for name in FUNCTIONS)
    return f"""#include <math.h>
#include <stdio.h>
{lines}
int main(void)
{{
    {real} (*each[])({real}) = {{{each}}}, x;
    double given;
    while (scanf("%lf", &given) == 1) {{
        x = ({real})given;
        for (int i = 0; i < {len(FUNCTIONS)}; i++) printf("%.17g\\n", (double)each[i](x));
    }}
}}
"""


def _called(name, language, suffix=""):
    own = FUNCTIONS[name]
    text = own.texts[language]
    return f"{text}{suffix}(x)" if own.is_in_library(language) else text


def _numbers(language, text):
    """The lines of a program in an interpreted language, of every function at every place."""
    words = {"inf": ("Inf", "Infinity"), "nan": ("NaN", "NaN")}

    def number(x):
        return words.get(str(abs(x)), (repr(float(x)),) * 2)[language == "javascript"]

    places = [("-" if x < 0 else "") + number(abs(x)) for x in PLACES]
    return "".join(
        text.format(x=x, f=_called(name, language)) for x in places for name in FUNCTIONS
    )


def by_c(folder, real="double", suffix=""):
    (folder / "every.c").write_text(c(real, suffix))
    line = ["cc", "-std=c99", "-O1", "-Wall", "-Wextra", "-Werror", "every.c", "-o", "every", "-lm"]
    subprocess.run(line, cwd=folder, check=True)
    return ["./every"]


def by_octave(folder):
    (folder / "every.m").write_text(_numbers("matlab", "x = {x}; printf('%.17g\\n', {f});\n"))
    return [OCTAVE, "--norc", "--quiet", "--no-gui", "every.m"]


def by_node(folder):
    (folder / "every.js").write_text(
        "let x;\n" + _numbers("javascript", "x = {x}; console.log({f});\n")
    )
    return ["node", "every.js"]


def by_python(folder):
    numbers = "import math\nfrom math import inf as Inf, nan as NaN\n"
    numbers += source("numpy-of-numbers.py.jinja") + "\n"
    (folder / "every.py").write_text(numbers + _numbers("python", "x = {x}; print(float({f}))\n"))
    return [sys.executable, "-S", "every.py"]


def by_numpy(folder):
    numbers = "import numpy as np\nfrom numpy import inf as Inf, nan as NaN\n"
    numbers += "np.seterr(all='ignore')\n"
    (folder / "every.py").write_text(numbers + _numbers("numpy", "x = {x}; print(float({f}))\n"))
    return [sys.executable, "every.py"]


@pytest.mark.parametrize(
    ("program", "command"),
    [(by_c, "cc"), (by_octave, ""), (by_node, "node"), (by_python, ""), (by_numpy, "")],
)
def test_every_language_has_the_numbers_of_numpy(program, command, tmp_path):
    """At infinite ones and beyond the domain as well: NaN where NumPy has NaN, nothing complex."""
    if program is by_octave and OCTAVE is None:
        pytest.skip(NO_OCTAVE)
    if command and shutil.which(command) is None:
        pytest.skip(f"there is no {command} here")
    compare(program(tmp_path), tmp_path, 1e-14)


def test_single_precision(tmp_path):
    compare(by_c(tmp_path, "float", "f"), tmp_path, 1e-5, np.abs(PLACES) < 100)


def compare(command, folder, close, rows=slice(None)):
    given = "\n".join(map(str, PLACES))
    done = subprocess.run(
        command, cwd=folder, input=given, capture_output=True, text=True, check=True
    )
    found = np.array([float(line.replace("Infinity", "inf")) for line in done.stdout.split()])
    with np.errstate(all="ignore"):
        expected = np.array([own.compute(PLACES) for own in FUNCTIONS.values()]).T
    for name, ours, theirs in zip(
        FUNCTIONS, found.reshape(expected.shape)[rows].T, expected[rows].T, strict=True
    ):
        np.testing.assert_allclose(ours, theirs, rtol=close, err_msg=name)


def test_equations_can_be_typeset():
    """By Matplotlib, which knows the functions of LaTeX, and by a browser."""
    for name, row in FUNCTIONS.items():
        MathTextParser("path").parse(f"${row.texts['latex'].replace('#', 'x')}$")
        assert fromstring(f"<math>{row.texts['mathml']}</math>").text != "#", name


@pytest.mark.parametrize("name", list(FUNCTIONS))
def test_the_slope_is_that_of_the_function(name):
    """On both sides of every kink, where the function has a value."""
    x, h = np.array([-2.3, -0.7, -0.2, 0.3, 0.7, 1.4]), 1e-6
    text = parse(f"{name}(2*x)")
    expected = (evaluate(text, {"x": x + h}) - evaluate(text, {"x": x - h})) / (2 * h)
    known = np.isfinite(expected)
    found = evaluate(derivative(text, "x"), {"x": x})
    np.testing.assert_allclose(found[known], expected[known], rtol=1e-7, atol=1e-8)
