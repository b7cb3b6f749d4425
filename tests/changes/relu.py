"""A function of expressions: the ramp, which is no ufunc of NumPy."""

FUNCTIONS = "modelling/expressions/functions.py"
BEFORE = '        function("sin",'
ROW = """        function(
            "relu",
            lambda x: np.maximum(x, 0.0),
            "0.5 + 0.5*sign(x)",
            numpy="np.maximum(x, 0.0)",
            python="0.0 if x <= 0 else x",
            c="x <= 0 ? 0 : x",
            matlab="max(x, 0) + 0 / (x == x)",
            javascript="x <= 0 ? 0 : x",
            latex=r"\\max\\left(0, #\\right)",
        ),
"""
ROOM = "modelling/terms/test_functions.py"


def _with(row):
    return {FUNCTIONS: [(BEFORE, row + BEFORE)]}


PATCH = _with(ROW)
WORKS = """
from mapmore_cli.modelling.expressions import parse, to_latex
from mapmore_cli.modelling.expressions.evaluation import evaluate
x = np.array([-1.0, 0.0, 2.0])
assert np.array_equal(evaluate(parse("relu(x)"), {"x": x}), [0, 0, 2])
assert "max" in to_latex(parse("relu(x)"))
"""
HALVES = {
    "without a text in TeX": (_with(ROW.replace("            latex", "            # latex")), ROOM),
    "without a text in C": (_with(ROW.replace('            c="x <= 0 ? 0 : x",\n', "")), ROOM),
    "that loses NaN in MATLAB": (_with(ROW.replace(" + 0 / (x == x)", "")), ROOM),
    "with another slope": (_with(ROW.replace("0.5 + 0.5*sign(x)", "sign(x)")), ROOM),
}
