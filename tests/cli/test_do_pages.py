"""The pages of *Do* and *Look up* show what their commands print; see `page_outputs`. What runs
only outside of this machine, a sketch and a node, is tried with stand-ins.
"""

import runpy
import shutil
import subprocess
import sys
import types
from pathlib import Path

import pytest
from cli_samples import BEGINS
from page_outputs import FENCE, run_page, steps_of

DOCS = Path(__file__).parents[2] / "docs"
QUICK = ("messages", "export-c", "controller", "defaults", "reproduce")
LONG = (
    "plan",
    "data",
    "several",
    "compare-formulas",
    "keep-rising",
    "tuning",
    "has-it-changed",
    "joint",
    "figures-for-papers",
    "export-simulink",
    "export-fmu-ros",
    "many",
)


@pytest.fixture
def quick_mapmore(begun, mapmore):
    """`mapmore`, which copies the results of the two first commands instead of repeating them."""
    folder, results = begun

    def call(*words, **options):
        for first, result, name in zip(BEGINS, results, ("muscle", "runs"), strict=True):
            if list(words[: len(first)]) == first and not Path(name).exists():
                shutil.copytree(folder / name, name)
                return result
        return mapmore(*words, **options)

    return call


@pytest.mark.usefixtures("mapmore", "batch_here")
@pytest.mark.parametrize(
    "page", [*QUICK, *(pytest.param(one, marks=pytest.mark.long) for one in LONG)]
)
def test_a_page_shows_what_its_commands_print(page, quick_mapmore, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run_page(DOCS / f"{page}.md", quick_mapmore)


def file_of(page, name):
    """The text of a file that a page shows."""
    return next(
        content
        for path, content in (step for step in steps_of(page) if isinstance(step, tuple))
        if path == name
    )


ARDUINO = """
#include <cstdio>
#define A0 0
#define A1 1
struct { void begin(long) {} void println(float x) { std::printf("%.2f\\n", x); }
         void println(const char *text) { std::puts(text); } } Serial;
int analogRead(int pin) { return pin == A0 ? 358 : 246; }  // 350 kPa, a strain of 0.06
void delay(int) {}
#include "muscle_sketch.ino"
int main() { setup(); loop(); }
"""


@pytest.mark.skipif(shutil.which("g++") is None, reason="there is no C++ compiler here")
def test_the_sketch_for_arduino_compiles_and_finds_the_force(begun, mapmore, tmp_path):
    """Its functions of the board are replaced by ones that know two voltages."""
    model = begun[0] / "runs" / "muscle" / "model.h5"
    mapmore("export", model, "--to", "c", "--float", "-o", tmp_path, "-q", code=0)
    sketch = file_of((DOCS / "export-c.md").read_text("utf-8"), "muscle_sketch/muscle_sketch.ino")
    (tmp_path / "muscle_sketch.ino").write_text(sketch)
    (tmp_path / "main.cpp").write_text(ARDUINO)
    for command in (
        "gcc -std=c99 -Wall -Werror -c muscle.c muscle_inverse.c",
        "g++ -Wall -Werror main.cpp muscle.o muscle_inverse.o -o sketch -lm",
    ):
        subprocess.run(command.split(), cwd=tmp_path, check=True)
    printed = subprocess.run(tmp_path / "sketch", capture_output=True, text=True, check=True)
    force, pressure = map(float, printed.stdout.split())
    assert force == pytest.approx(250, abs=2)
    assert 80 < pressure < 350


def test_the_node_for_ros_publishes_the_force(begun, mapmore, tmp_path, monkeypatch):
    """A module takes the place of rclpy, and calls the node as ROS would."""
    sent, warned, callbacks = [], [], {}

    class Node:
        def __init__(self, name):
            self.name = name

        def create_subscription(self, _type, topic, callback, _depth):
            callbacks[topic] = callback

        def create_publisher(self, _type, _topic, _depth):
            return types.SimpleNamespace(publish=sent.append)

        def create_timer(self, seconds, callback):
            callbacks[seconds] = callback

        def get_logger(self):
            return types.SimpleNamespace(warning=warned.append)

    def spin(_node):
        for strain in (0.06, 0.3):
            callbacks[0.01]()
            callbacks["pressure"](types.SimpleNamespace(data=350.0))
            callbacks["strain"](types.SimpleNamespace(data=strain))
            callbacks[0.01]()

    rclpy = types.ModuleType("rclpy")
    rclpy.init, rclpy.spin = lambda: None, spin
    for name, members in {
        "rclpy": {},
        "rclpy.node": {"Node": Node},
        "std_msgs": {},
        "std_msgs.msg": {"Float64": types.SimpleNamespace},
    }.items():
        module = rclpy if name == "rclpy" else types.ModuleType(name)
        vars(module).update(members)
        monkeypatch.setitem(sys.modules, name, module)
    model = begun[0] / "runs" / "muscle" / "model.h5"
    mapmore("export", model, "--to", "py", "-o", tmp_path, "-q", code=0)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "muscle", raising=False)
    node = file_of((DOCS / "export-fmu-ros.md").read_text("utf-8"), "ros/force_node.py")
    (tmp_path / "force_node.py").write_text(node)
    runpy.run_path(str(tmp_path / "force_node.py"), run_name="__main__")
    monkeypatch.delitem(sys.modules, "muscle", raising=False)
    assert [round(one.data, 3) for one in sent] == [250.416, 250.416, -30.058]
    assert warned == ["outside of the training data"]


def test_the_first_example_of_the_page_of_python_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    _, block = next(
        found
        for found in FENCE.findall((DOCS / "python.md").read_text("utf-8"))
        if found[0] == "python"
    )
    names = {}
    exec(block, names)
    assert names["model"].scores.of_model()["nrmse"] < 0.01
    assert (tmp_path / "model.h5").is_file()
