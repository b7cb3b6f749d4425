"""What all tests share."""

import gc
import os
import signal
from pathlib import Path

import pytest
from hypothesis import settings

from mapmore_cli.pipeline import processors

# Examples of a property that asks for no number of its own; `make test-all` takes the third profile
settings.register_profile(
    "ci", derandomize=True, deadline=None, max_examples=40
)  # a change fails for what it does, not for the draw
settings.register_profile("search", deadline=None, max_examples=40)
settings.register_profile("all", deadline=None, max_examples=200)
settings.load_profile("ci" if os.environ.get("CI") else "search")

# programs that tests interrupt get Ctrl-C as in a terminal; a job in the background ignores it
signal.signal(signal.SIGINT, signal.default_int_handler)

PROJECT = Path(__file__).resolve().parent.parent


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """What collecting makes stays to the end: let the garbage collector not look through it again
    and again, and less often afterwards.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()
        gc.set_threshold(20_000, 20, 20)


@pytest.fixture(scope="session", autouse=True)
def no_power_cut():
    """Nothing that a test writes has to outlive a power cut, and waiting for the disk takes as long
    as the work itself.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda _file: None)
        yield


@pytest.fixture(scope="session", autouse=True)
def no_copies():
    """Work of this process is done in it, where a test may count and replace; commands in processes
    of their own share it out.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(processors, "free_processors", lambda: 1)
        yield


@pytest.fixture
def fewer_families(monkeypatch):
    """A search without the families that take long; their candidates are made in
    `test_search_families`.
    """
    search_only(monkeypatch, "tables", "feedback")


def search_only(monkeypatch, *names):
    from mapmore_cli.annexes.search import searching

    monkeypatch.setattr(searching, "FAMILIES", names)


@pytest.fixture(scope="session")
def measured_data():
    """Folder of the measured recordings, which are not part of the project; see docs/data.md for
    where to get them.
    """
    root = Path(os.environ.get("MAPMORE_DATA") or PROJECT.parent / "shared" / "data").absolute()
    if not root.is_dir():
        pytest.skip(f"no measured recordings in {root}; set MAPMORE_DATA to their folder")
    return root
