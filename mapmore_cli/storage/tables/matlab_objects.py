"""Refuse objects of MATLAB, for example tables and time series. Only MATLAB can read the contents
of such an object, so the message shows the MATLAB commands that save its numbers as plain arrays.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from mapmore_cli.domain.errors import DataError

_SAVED = "save('log.mat', '-struct', 'S')"
_APPENDED = "save('log.mat', 'x', '-append'), where log.mat is this file, and name the column x"

REMEDIES: Mapping[str, str] = {
    "table": f"S = table2struct({{name}}, 'ToScalar', true); {_SAVED}",
    "timetable": (
        "t = {name}.Properties.RowTimes; T = timetable2table({name}, 'ConvertRowTimes', false); "
        f"S = table2struct(T, 'ToScalar', true); S.t = seconds(t - t(1)); {_SAVED}"
    ),
    "timeseries": "t = {name}.Time; y = squeeze({name}.Data); save('log.mat', 't', 'y')",
    "datetime": f"x = seconds({{name}} - {{name}}(1)); {_APPENDED}",
    "duration": f"x = seconds({{name}}); {_APPENDED}",
    "categorical": f"x = double({{name}}); {_APPENDED}",
    "string": f"x = str2double({{name}}); {_APPENDED}",
    "containers.Map": "S = cell2struct(values({name}), keys({name}), 2); " + _SAVED,
    "function_handle": "y = {name}(t); save('log.mat', 't', 'y')",
}
"""Commands of MATLAB that save the numbers of an object, by the class of the object."""

_ALIKE = {"a function": "function_handle", "inline": "function_handle"}


def object_of_matlab(name: str, of_class: str) -> DataError:
    """Return the error for an object whose contents only MATLAB can read. The remedy in its message
    is a list of MATLAB commands that save the numbers of the object as plain arrays.
    """
    words = of_class or "a table, datetime, timeseries, string or the like"
    # MATLAB has no name for an element of a cell array
    written = name if re.fullmatch(r"[A-Za-z]\w*(\.[A-Za-z]\w*)*", name) else "x"
    usual = REMEDIES["table"] if not of_class else "S = struct({name}); " + _SAVED
    commands = REMEDIES.get(_ALIKE.get(of_class, of_class), usual).replace("{name}", written)
    line, comma, more = commands.partition(", where")
    return DataError(
        f"'{name}' is an object of MATLAB ({words}), not an array of numbers",
        f"save plain arrays in MATLAB: `{line}`{comma}{more}",
    )
