"""The examples in docstrings are true."""

import doctest
import importlib
import pkgutil

import pytest

import mapmore_cli

MODULES = [
    module.name
    for module in pkgutil.walk_packages(mapmore_cli.__path__, "mapmore_cli.")
    if "__main__" not in module.name
]


def with_examples():
    """Modules whose docstrings have examples that can run."""
    finder = doctest.DocTestFinder(exclude_empty=True)
    found = {
        name: [one for test in finder.find(importlib.import_module(name)) for one in test.examples]
        for name in MODULES
    }
    return [
        name
        for name, examples in found.items()
        if any(doctest.SKIP not in one.options for one in examples)
    ]


EXAMPLES = with_examples()


def test_there_are_examples():
    assert "mapmore_cli.modelling.frols.engine" in EXAMPLES


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_examples_are_true(name):
    result = doctest.testmod(
        importlib.import_module(name), optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
    )
    assert result.attempted > 0
    assert result.failed == 0
