"""Options for tables of other programs, and remedies that name them."""

from pathlib import Path

import pytest

from mapmore_cli.cli.table_options import BY_OPTIONS, remedies_by_options, table_options
from mapmore_cli.domain.errors import DataError, UsageError


def test_options_become_what_a_reader_is_asked():
    columns = ["pressure = P [bar]", "strain=2", "load=a=b"]
    options = table_options(";", ",", None, "two", columns, ["pressure=bar, strain=%", "load=kg"])
    assert options.settings == {"delimiter": ";", "decimal": ",", "sheet": "two"}
    assert options.columns == {"pressure": "P [bar]", "strain": 2, "load": "a=b"}
    assert options.units == {"pressure": "bar", "strain": "%", "load": "kg"}
    bare = table_options(None, None, ".", None, [], [])
    assert (bare.settings, bare.columns, bare.units) == ({"thousands": "."}, {}, {})


@pytest.mark.parametrize("text", ["pressure", "=bar", "pressure=", " = "])
def test_a_pair_has_a_name_and_a_value(text):
    with pytest.raises(UsageError, match="is not of the form NAME=") as error:
        table_options(None, None, None, None, [], [text])
    assert error.value.remedy == "write `--units pressure=bar`"
    with pytest.raises(UsageError) as error:
        table_options(None, None, None, None, [text], [])
    assert error.value.remedy == "write `--columns pressure='P [bar]'`"


@pytest.mark.parametrize("remedy", ["say `decimal: ,`", None])
@pytest.mark.parametrize(
    ("table", "message", "is_named"),
    [
        (Path("in", "t.csv"), "in/t.csv:row 2: no number", True),
        (Path("in", "t.csv"), "t.csv: there is no column", True),
        (Path("in", "t.csv"), "the model m has no intervals", False),
        (Path("-"), "stdin: there is no column", False),
        (None, "t.csv: there is no column", False),
    ],
)
def test_remedies_of_tables_name_options(table, message, is_named, remedy):
    with pytest.raises(DataError) as error, remedies_by_options(table):
        raise DataError(message, remedy)
    expected = "\n  ".join(filter(None, [remedy, BY_OPTIONS])) if is_named else remedy
    assert error.value.remedy == expected
