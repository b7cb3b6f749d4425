"""A transition: smootherstep, whose second derivative is continuous too."""

TRANSITIONS = "domain/joining.py"
BEFORE = '    "cubic": Transition('
ROW = """    "smootherstep": Transition(
        "w = 6*t^5 - 15*t^4 + 10*t^3", lambda _m, t: 6 * t**5 - 15 * t**4 + 10 * t**3
    ),
"""
ROOM = "modelling/pieces/test_transitions.py"


def _with(row):
    return {TRANSITIONS: [(BEFORE, row + BEFORE)]}


PATCH = _with(ROW)
WORKS = """
from mapmore_cli.study.loader import load
Path("joined.yaml").write_text('''
name: joined
data: {files: [a.csv], columns: {strain: {column: e}, force: {column: F}}}
target: {column: force}
segment: {strain: {method: even, count: 2}}
dictionary: [{polynomial: {of: [strain], order: 1}}]
fuse: {transition: smootherstep}
''')
assert load(Path("joined.yaml")).spec.fuse.transition == "smootherstep"
"""
HALVES = {
    "in other words": (_with(ROW.replace("w = 6", "w = 5")), ROOM),
    "of other mathematics": (_with(ROW.replace(": 6 *", ": 5 *")), ROOM),
}
