"""The bench begins: whatever its measurements import is there."""

import json
import sys
from pathlib import Path

from common import process


def test_the_bench_begins(tmp_path):
    written = tmp_path / "bench.json"
    run = Path(__file__).with_name("run.py")
    process(sys.executable, run, "--only", "nothing", "--output", written, check=True)
    assert json.loads(written.read_text()).keys() == {"machine"}
