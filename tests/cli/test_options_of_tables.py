"""Options for tables of other programs, and remedies that name them."""

import pytest

from mapmore_cli.cli.table_options import remedies_by_options, table_options
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


@pytest.mark.parametrize(
    ("message", "remedy", "by_options"),
    [
        ("a", "say `decimal: ,`", "say `--decimal ,`"),
        (
            "two sheets",
            "name the sheet to read with `sheet`",
            "name the sheet to read with `--sheet TITLE`",
        ),
        ("read as force", "say `unit: kN`", "say `--units force=kN`"),
        ("column 'force'", "say `unit: kN`", "say `--units force=kN`"),
        ("column F [N]", "say `unit: kN`", "say `--units load=kN`"),
        ("'F [N]' has no unit", "say `unit: kN`", "say `--units load=kN`"),
        ("a", "say `unit: kN`", "say `--units NAME=kN`"),
        ("a", "Write `missing: [x]`. Or correct it", "Or correct it"),
        ("a", None, "correct the table"),
        ("a", "put it in `columns`", "correct the table"),
        (
            "there is no column P",
            "Did you mean 'p'?",
            "Did you mean 'p'? "
            "Name the right column, for example with `--columns P='p' --units P=UNIT`.",
        ),
        (
            "read as load: there is no column P",
            "It has x.",
            "It has x. "
            "Name the right column, for example with `--columns load='TITLE' --units load=UNIT`.",
        ),
        ("there is no column P", "use `decimal: ,`", "use `--decimal ,`"),
    ],
)
def test_remedies_name_options(message, remedy, by_options):
    options = table_options(None, None, None, None, ["load=F [N]"], [])
    with pytest.raises(DataError) as error, remedies_by_options(options):
        raise DataError(message, remedy)
    assert error.value.remedy == by_options
