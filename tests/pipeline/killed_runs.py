"""Runs a fake study again and again, killed at one file-system event after the other; prints what
went wrong as JSON.

The events are the interpreter's audit events of every open, mkdir, rename, remove and rmdir, and
those that the fake stages raise between two halves of a file. Each child is a fork that kills
itself, so a run at every instant takes seconds. What comes after a kill depends on the files alone:
it is tried once for each state of the folder, since most events only read.
"""

import json
import os
import re
import shutil
import signal
import sys
from itertools import count
from pathlib import Path

from fake_study import contents, fake_stages, make_data, study

from mapmore_cli.pipeline.runner import bring_up_to_date

EVENTS = {
    "open",
    "os.mkdir",
    "os.rename",
    "os.remove",
    "os.rmdir",
    "os.scandir",
    "shutil.rmtree",
    "tempfile.mkdtemp",
    "fake.step",
}


# whoever is killed leaves a disk that goes on: no power cut, and no waiting for one
os.fsync = lambda _file: None


def update(loaded):
    bring_up_to_date(
        loaded, loaded.folder / "runs", stages=fake_stages(lambda _step: sys.audit("fake.step"))
    )


def killed_at(event, loaded):
    """Run in a fork that dies just before its event of that number; False where it came to its
    end.
    """
    child = os.fork()
    if child == 0:
        seen = count()
        sys.addaudithook(
            lambda name, _arguments: (
                os.kill(os.getpid(), signal.SIGKILL)
                if name in EVENTS and next(seen) == event
                else None
            )
        )
        update(loaded)
        os._exit(0)
    status = os.waitpid(child, 0)[1]
    if os.WIFSIGNALED(status):
        return True
    assert os.WEXITSTATUS(status) == 0
    return False


CHANCE = re.compile(
    r'(?<=\.tmp-)[0-9a-f]{12}(?=-)|(?<=-)[a-z0-9_]{8}(?=$|/)|(?<=time_ns": '
    r')[0-9]+|(?<="inode": )[0-9]+|(?<="seconds": )[0-9.e-]+'
)
"""What is another in each run: the ends of temporary names, instants and durations."""


def state(run_dir):
    """All that a kill leaves, hidden files and folders too; and of each file whether the record
    knows its instant.
    """
    record = (run_dir / "run.json").read_text()
    return frozenset(
        (
            CHANCE.sub("", path.relative_to(run_dir).as_posix()),
            "" if path.is_dir() else CHANCE.sub("", path.read_text()),
            str(path.stat().st_mtime_ns) in record,
        )
        for path in run_dir.rglob("*")
    )


def main(folder):
    make_data(folder)
    old, new = (
        study(folder),
        study(folder, fit={"max_terms": 2}, fuse={"z_s": 0.5}, report={"formats": ["csv"]}),
    )
    run_dir = folder / "runs" / "demo"
    update(old)
    before, start = contents(run_dir), folder / "start"
    shutil.copytree(run_dir, start)
    update(new)
    after, wrong, kills, seen = contents(run_dir), [], 0, set()
    for event in count():
        shutil.rmtree(run_dir)
        shutil.copytree(start, run_dir)
        if not killed_at(event, new):
            break
        kills += 1
        if (found := state(run_dir)) in seen:
            continue
        seen.add(found)
        left = contents(run_dir)
        if any(text not in (before.get(name), after.get(name)) for name, text in left.items()):
            wrong.append(f"{event}: not whole: {sorted(left)}")
        json.loads((run_dir / "run.json").read_text())
        if len(seen) % 3 == 1:  # now and then somebody wants the old settings back
            update(old)
            if contents(run_dir) != before:
                wrong.append(f"{event}: the old settings do not give the old results")
        update(new)
        if contents(run_dir) != after:
            wrong.append(f"{event}: the next run does not finish the work")
        if hidden := [
            path.name
            for path in run_dir.iterdir()
            if path.name.startswith(".") and path.name != ".lock"
        ]:
            wrong.append(f"{event}: left behind: {hidden}")
    print(json.dumps({"kills": kills, "states": len(seen), "wrong": wrong}))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
