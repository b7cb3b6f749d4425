"""A few disturbed commands; `make torture` tries as many as one likes. Every instant of a run:
tests/pipeline.
"""

from pathlib import Path

from common import python

HERE = Path(__file__).parent

SCRIPT = """
import json, sys
from torture import torture
ends, wrong = torture(4, 16, ("fit", "freeze"))
print(json.dumps({"ends": {how: found.total() for how, found in ends.items()}, "wrong": wrong}))
"""


def test_disturbed_commands_leave_whole_files(tmp_path):
    import json

    done = python(SCRIPT, cwd=HERE, check=True)
    outcome = json.loads(done.stdout.splitlines()[-1])
    assert outcome["wrong"] == []
    assert sum(outcome["ends"].values()) == 4
