"""Runs as processes: killed at every instant, locked out, quick when up to date, one BLAS
thread.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from common import python
from fake_study import fake_stages, make_data, study

from mapmore_cli.domain.errors import WriteError
from mapmore_cli.pipeline.runner import bring_up_to_date

HERE = Path(__file__).parent
ENVIRONMENT = {"OPENBLAS_NUM_THREADS": "2", "PYTHONPATH": str(HERE)}


def printed(script, folder):
    """The JSON that a script prints; it finds the folder in sys.argv[1]."""
    done = python(script, folder, check=True, env=ENVIRONMENT, timeout=120)
    return json.loads(done.stdout)


def test_killed_at_every_instant(tmp_path):
    outcome = printed(
        f"import runpy; runpy.run_path({str(HERE / 'killed_runs.py')!r}, run_name='__main__')",
        tmp_path,
    )
    assert outcome["wrong"] == []
    assert outcome["kills"] > 60


LOCKED = """
import sys, time
from pathlib import Path
from fake_study import fake_stages, study
from mapmore_cli.pipeline.runner import bring_up_to_date

def wait(step):
    print(step, flush=True)
    time.sleep(60)

folder = Path(sys.argv[1])
bring_up_to_date(study(folder), folder / "runs", stages=fake_stages(wait))
"""


def test_run_is_locked_while_another_process_writes_it(tmp_path):
    make_data(tmp_path)
    with subprocess.Popen(
        [sys.executable, "-c", LOCKED, str(tmp_path)],
        env=ENVIRONMENT,
        stdout=subprocess.PIPE,
        text=True,
    ) as other:
        assert other.stdout.readline() == "start of ingest\n"
        before = sorted((tmp_path / "runs" / "demo").iterdir())
        with pytest.raises(WriteError, match="demo: another process") as caught:
            bring_up_to_date(study(tmp_path), tmp_path / "runs", stages=fake_stages())
        assert caught.value.exit_code == 7
        # the other's unfinished work is left alone
        assert sorted((tmp_path / "runs" / "demo").iterdir()) == before
        other.kill()
    outcome = bring_up_to_date(study(tmp_path), tmp_path / "runs", stages=fake_stages())
    assert set(outcome.stages.values()) == {"done"}


UP_TO_DATE = """
import json, sys
from pathlib import Path
from fake_study import fake_stages, study
from mapmore_cli.pipeline.runner import bring_up_to_date

folder = Path(sys.argv[1])
outcome = bring_up_to_date(study(folder), folder / "runs", stages=fake_stages())
print(json.dumps([outcome.stages, sorted({name.split(".")[0] for name in sys.modules})]))
"""


def test_an_up_to_date_run_loads_nothing_heavy(tmp_path):
    make_data(tmp_path)
    bring_up_to_date(study(tmp_path), tmp_path / "runs", stages=fake_stages())
    stages, modules = printed(UP_TO_DATE, tmp_path)
    assert set(stages.values()) == {"up-to-date"}
    assert not {"h5py", "scipy", "matplotlib", "pint", "jinja2", "threadpoolctl"} & set(modules)


PIPELINE = """
import json, sys
from mapmore_cli.pipeline.staleness import pipeline

names = [stage.name for stage in pipeline()]
alone = {name.split(".")[0] for name in sys.modules}
import mapmore_cli.cli.views, mapmore_cli.annexes.search.stage

print(json.dumps([names, sorted(alone), sorted({name.split(".")[0] for name in sys.modules})]))
"""


def test_real_stages_are_cheap_to_import(tmp_path):
    names, alone, modules = printed(PIPELINE, tmp_path)
    assert names == ["ingest", "segment", "fit", "fuse", "validate", "report"]
    assert not {"h5py", "scipy", "matplotlib", "pint", "jinja2"} & {*alone}
    assert not {"scipy", "matplotlib", "pint", "jinja2"} & {*modules}


ONE_THREAD = """
import json, sys
from dataclasses import replace
from pathlib import Path
from fake_study import fake_stages, study
from mapmore_cli.pipeline.runner import bring_up_to_date

threads = []

def work(_part, workspace):
    import numpy, scipy.linalg
    from threadpoolctl import threadpool_info
    threads.extend(pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas")
    (workspace.out / "ingest.h5").touch()

folder = Path(sys.argv[1])
bring_up_to_date(study(folder), folder / "runs", "ingest", stages=[replace(fake_stages()[0],
    run=work)])
print(json.dumps(threads))
"""


def test_stages_have_one_blas_thread(tmp_path):
    make_data(tmp_path)
    threads = printed(ONE_THREAD, tmp_path)
    assert threads
    assert set(threads) == {1}
