"""A canonical quantity: the temperature, in a unit with a zero of its own."""

UNITS = "study/units.py"
ROW = '        "input": "V",\n'
PATCH = {UNITS: [(ROW, f'{ROW}        "temperature": "degC",\n')]}
WORKS = """
from mapmore_cli.study.units import default_unit, is_canonical
from mapmore_cli.study.loader import load
assert is_canonical("temperature_rate") and default_unit("temperature_rate") == "degC/s"
Path("heat.yaml").write_text('''
name: heat
data:
  files: [a.csv]
  columns:
    temperature: {column: T, unit: K, offset: 1 degF}
    force: {column: F}
  keep: [{quantity: temperature, above: 300 K}]
target: {column: force}
dictionary: [{polynomial: {of: [temperature], order: 1}}]
''')
data = load(Path("heat.yaml")).spec.data
assert abs(data.columns["temperature"].offset - 5 / 9) < 1e-12
assert abs(data.keep[0].above - 26.85) < 1e-12
"""
TEST = "study/test_units.py::test_every_canonical_quantity_has_a_name_and_a_unit_that_are_known"
HALVES = {
    "in a unit that nobody knows": ({UNITS: [(ROW, f'{ROW}        "heat": "celsus",\n')]}, TEST),
    "with a name that no spec may write": (
        {UNITS: [(ROW, f'{ROW}        "of air": "K",\n')]},
        TEST,
    ),
}
