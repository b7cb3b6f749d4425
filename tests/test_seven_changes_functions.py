"""Two ordinary changes are one file each: a function of expressions, and a transition.

Each is made on a copy of the package, as somebody new to the code would; then the tests of its
room pass, a study uses it, and exports have it. Made half, a test of its room fails.
"""

import shutil
import sys
from functools import partial
from pathlib import Path

import pytest
from common import mapmore, process

PROJECT = Path(__file__).resolve().parents[1]
FUNCTIONS = "modelling/expressions/functions.py"
TRANSITIONS = "domain/joining.py"
RELU = """        function(
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
SMOOTHERSTEP = """    "smootherstep": Transition(
        "w = 6*t^5 - 15*t^4 + 10*t^3", lambda _m, t: 6 * t**5 - 15 * t**4 + 10 * t**3
    ),
"""
ROOM = {
    FUNCTIONS: "tests/modelling/terms/test_functions.py",
    TRANSITIONS: "tests/modelling/pieces/test_transitions.py",
}
BEFORE = {FUNCTIONS: '        function("sin",', TRANSITIONS: '    "cubic": Transition('}
DONE = {"relu": (FUNCTIONS, RELU), "smootherstep": (TRANSITIONS, SMOOTHERSTEP)}
HALF = {
    "relu without a text in C": (FUNCTIONS, RELU.replace('            c="x <= 0 ? 0 : x",\n', "")),
    "relu that loses NaN in MATLAB": (FUNCTIONS, RELU.replace(" + 0 / (x == x)", "")),
    "relu with another slope": (FUNCTIONS, RELU.replace("0.5 + 0.5*sign(x)", "sign(x)")),
    "smootherstep in other words": (TRANSITIONS, SMOOTHERSTEP.replace("w = 6", "w = 5")),
    "smootherstep of other mathematics": (TRANSITIONS, SMOOTHERSTEP.replace(": 6 *", ": 5 *")),
}


def changed(folder, file, row):
    """Make the change on a copy of the package; return what a process sees the copy by."""
    copy = folder / "changed" / "mapmore_cli"
    shutil.copytree(PROJECT / "mapmore_cli", copy)
    text = (copy / file).read_text()
    assert text.count(BEFORE[file]) == 1
    (copy / file).write_text(text.replace(BEFORE[file], row + BEFORE[file]))
    return {"PYTHONPATH": str(copy.parent)}


def room_tests(env, folder, file):
    return process(
        *(sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider"),
        *("-o", f"pythonpath={env['PYTHONPATH']} tests/exporting tests/modelling/pieces"),
        PROJECT / ROOM[file],
        env=env,
        cwd=folder,
    )


@pytest.mark.parametrize("change", DONE)
def test_a_change_is_one_file(change, tmp_path):
    file, row = DONE[change]
    done = room_tests(changed(tmp_path, file, row), tmp_path, file)
    assert done.returncode == 0, done.stdout


@pytest.mark.long
@pytest.mark.parametrize(
    ("change", "setting", "on_page"),
    [
        ("relu", 'dictionary=[{terms: ["1", strain, "relu(strain - 0.4)"]}]', "relu"),
        ("smootherstep", "fuse.transition=smootherstep", "6*t^5"),
    ],
)
def test_a_study_uses_the_change_and_exports_have_it(change, setting, on_page, tmp_path):
    """Each export is compared with `predict` as it is written."""
    run = partial(mapmore, cwd=tmp_path, env=changed(tmp_path, *DONE[change]))
    assert run("example", "study").returncode == 0
    quick = ("--set", "report.figures=[]", "--set", "validate={}", "-q")
    ran = run("run", "study/study.yaml", "--runs", "runs", "--set", setting, *quick)
    assert ran.returncode == 0, ran.stderr
    (model,) = tmp_path.glob("runs/*/model.h5")
    for to in ("c", "py", "numpy", "matlab"):
        written = run("export", model, "--to", to)
        assert written.returncode == 0, written.stderr
    page = (model.parent / "report" / "index.html").read_text()
    assert on_page in page


@pytest.mark.long
@pytest.mark.parametrize("change", HALF)
def test_a_change_that_is_made_half_fails_in_its_room(change, tmp_path):
    file, row = HALF[change]
    assert row not in {RELU, SMOOTHERSTEP}
    assert room_tests(changed(tmp_path, file, row), tmp_path, file).returncode == 1
