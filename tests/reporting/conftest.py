import numpy as np
import pytest
from matplotlib.figure import Figure
from report_builder import PUBLISHED, build, surface


@pytest.fixture(scope="session")
def inputs():
    return build(published=PUBLISHED)


@pytest.fixture(scope="session")
def mixed():
    """Strains between 0.02 and 0.035 held out of every curve."""
    return build(held_out=lambda _level, strain: (strain > 0.02) & (strain < 0.035))


@pytest.fixture(scope="session")
def failed():
    """Sarosi's model could not be fitted, another could."""
    return build(
        competitors={
            "sarosi": lambda p, _e: np.full_like(p, np.nan),
            "flat": lambda p, e: surface(p, e) + 20,
        }
    )


@pytest.fixture(scope="session")
def alone():
    """One curve, nothing held out, no competitor."""
    return build(
        levels=[250],
        held_out=lambda _level, strain: np.zeros(len(strain), dtype=bool),
        competitors={},
    )


@pytest.fixture
def ax():
    return Figure().subplots()
