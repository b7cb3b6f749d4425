"""One thread for linear algebra, as the stages run it: two threads on a busy machine wait for each
other most of the time.
"""

import pytest
from threadpoolctl import threadpool_limits


@pytest.fixture(autouse=True, scope="module")
def one_thread():
    """Hold the limit over a file of tests."""
    with threadpool_limits(limits=1):
        yield
