"""Model files that somebody made with our own writer: right checksums, and every text and number as
hostile as he likes.

Each is read, shown, predicted, inverted, and exported to every language. It is refused with an exit
code other than 1, or done; no text of it runs, and no file is made.
"""

import dataclasses
import json
import sys
from collections.abc import Mapping
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import exports
import numpy as np
from driver import Fault, Target, refused
from hostile_texts import COMMANDS, ESCAPES, text_of

sys.path.insert(0, str(Path(__file__).parents[1] / "storage"))

from used_files import table_of

from mapmore_cli.annexes.exporting.exports import exported
from mapmore_cli.cli.console import print_view
from mapmore_cli.cli.views import of_file
from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.pipeline.predict import inverted_lines, predicted_lines
from mapmore_cli.storage import artefacts
from mapmore_cli.storage.artefacts import schema

TEXTS = (
    *(
        "",
        " ",
        "time",
        "1",
        "0",
        "strain",
        "speed",
        "x",
        "_",
        "con",
        "NAN",
        "ß",
        "é",
        "a b",
        "a/b",
        "..",
        "*/",
        "O'Brien",
        "k",
        "true",
    ),
    *(
        "\"+__import__('os').system('touch MARK')+\"",
        "';touch MARK;'",
        "$(touch MARK)",
        "`touch MARK`",
        "</script>",
        "{{7*7}}",
        "%s%n",
    ),
    *(
        "strain^",
        "speed^2",
        "1/0",
        "1/(strain-strain)",
        "exp(exp(exp(9)))",
        "9^99*9^99",
        "force[k-1]",
        "force[k-999999]",
        "k-1",
        "()",
    ),
    *(
        "oracle(strain)",
        "slow(pressure, 0)",
        "slow(pressure, -1)",
        "play(pressure, 9)",
        "resonance(pressure)",
        "wen(force[k-1])",
    ),
    *(
        "((((" * 60,
        "-" * 200,
        "x" * 9000,
        "+".join(["strain"] * 900),
        "log(-1)",
        "sqrt(-strain)",
        "1e308*1e308",
        "strain^1e9",
    ),
    *(
        '{"name": "x"}',
        '{"family": {}}',
        '{"family": 1}',
        "{",
        '{"bounds": {}, "text": "1", "name": "*/", "reference": "", "units": {}}',
    ),
    *(
        "polynomial_2",
        "tondu_lopez",
        "sarosi",
        "nobody",
        "saturate",
        "zero",
        "continue_linear",
        "failed",
        "converged",
        "measured",
    ),
    *(
        "steady",
        "identified",
        "rest",
        "hard",
        "bumpless",
        "carried",
        "rate",
        "direction",
        "levels",
        "pchip",
        "linear",
        "rise",
        "fall",
    ),
)
NUMBERS = (
    0,
    1,
    -1,
    2,
    3,
    0.5,
    -0.0,
    1e-300,
    1e300,
    -1e308,
    5e-324,
    2**31,
    2**53,
    10**9,
    float("nan"),
    float("inf"),
    float("-inf"),
)
LANGUAGES = ("c", "py", "numpy", "tex", "mujoco", "simulink", "table", "csv", "fmu")


def hostile(chance, mark):
    kind = chance.random()
    if kind < 0.5:
        return chance.choice(TEXTS).replace("MARK", mark)
    return (
        chance.choice((*ESCAPES, *COMMANDS)).replace("MARK", mark)
        if kind < 0.75
        else text_of(chance, mark)
    )


def places(record):
    """The ways to every part of a record."""
    parts = ()
    if dataclasses.is_dataclass(record):
        parts = [(one.name, getattr(record, one.name)) for one in dataclasses.fields(record)]
    elif isinstance(record, Mapping):
        parts = [*record.items()]
    elif isinstance(record, tuple):
        parts = [*enumerate(record)]
    for step, part in parts:
        yield (step,)
        yield from ((step, *way) for way in places(part))


def changed(record, way, change):
    """A record with another part at the end of a way."""
    if not way:
        return change(record)
    step, *rest = way
    if isinstance(record, Mapping):
        return {
            key: changed(one, tuple(rest), change) if key == step else one
            for key, one in record.items()
        }
    if isinstance(record, tuple):
        return tuple(
            changed(one, tuple(rest), change) if place == step else one
            for place, one in enumerate(record)
        )
    return dataclasses.replace(
        record, **{step: changed(getattr(record, step), tuple(rest), change)}
    )


def forged(part, chance, mark):
    """Another value in place of a part; not always of its type."""
    match part:
        case str():
            return hostile(chance, mark)
        case bool() | int():
            return chance.choice([not part, *map(int, NUMBERS[:6]), 10**9, -5])
        case float() | None:
            return chance.choice(
                [float(chance.choice(NUMBERS)), None if chance.random() < 0.1 else 1.0]
            )
        case np.ndarray():
            return _other_array(part, chance)
        case range():
            return range(chance.choice([-1, 0, part.stop]), chance.choice([0, part.stop, 2**40]))
        case tuple():
            more = (*part, *part[:1]), part[:-1], part[::-1], (), part * 2, part[1:]
            return chance.choice(more)
        case Mapping():
            keys = [*part]
            if not keys or chance.random() < 0.3:
                return {**part, hostile(chance, mark): next(iter(part.values()), 1.0)}
            out = chance.choice(keys)
            rest = {key: one for key, one in part.items() if key != out}
            return rest if chance.random() < 0.5 else {**rest, hostile(chance, mark): part[out]}
    return None if chance.random() < 0.3 else part


def _other_array(part, chance):
    flat = part.copy()
    match chance.randrange(5):
        case 0 if flat.size:
            value = chance.choice(NUMBERS)
            flat.flat[chance.randrange(flat.size)] = (
                value if flat.dtype.kind == "f" else chance.choice([-1, 0, 1, 2**40])
            )
        case 1:
            return flat[::-1].copy()
        case 2:
            return flat[:-1]
        case 3:
            return np.concatenate([flat, flat])
        case _:
            return -flat if flat.dtype.kind == "f" else flat[:0]
    return flat


def model_of(chance, mark):
    """A sound model with one to three forged parts, or with all texts of one kind of field
    forged.
    """
    model = chance.choice(exports.bodies())
    if chance.random() < 0.15:
        return exports.model_of(chance, mark)
    for _ in range(chance.choice([1, 1, 1, 2, 3])):
        ways = [*places(model)]
        texts = [way for way in ways if isinstance(_at(model, way), str)]
        way = chance.choice(texts if chance.random() < 0.5 else ways)
        model = changed(model, way, lambda part: forged(part, chance, mark))
    return model


def _at(record, way):
    for step in way:
        record = getattr(record, step) if dataclasses.is_dataclass(record) else record[step]
    return record


def write_forged(path, model):
    """Write a model as our writer does, texts that it would refuse included; the checksum is
    right.
    """
    ascii_only = SimpleNamespace(dumps=lambda document, **_: json.dumps(document))
    with (
        patch.object(schema, "_scalar", lambda value: value),
        patch.object(artefacts, "json", ascii_only),
    ):
        artefacts.write_model(path, model)


def attempt(chance, number, folder):
    """Forge a model, and do all that commands do with it."""
    mark, path = folder / f"mark{number}", folder / "model.h5"
    try:
        write_forged(path, model_of(chance, str(mark)))
    except (
        KeyError,
        ValueError,
        TypeError,
        AttributeError,
        StopIteration,
        OverflowError,
        MapmoreError,
    ):
        return "not written"
    try:
        return use(path, chance, number)
    finally:
        if mark.exists():
            raise Fault("a text ran")


def use(path, chance, number):
    """What became of a model: refused when it was read, or used as far as it goes."""
    told = []
    try:
        model = artefacts.read_model(path, told.append)
        with redirect_stdout(StringIO()):
            view = of_file(path, told.append, False)
            print_view(view, False)
            print_view(view, True)
    except MapmoreError as error:
        if error.exit_code != 4:
            raise
        return refused(error)
    grid = ",".join(f"{one.name}=0:1:0.5" for one in model.inputs)
    inputs, wanted = [one.name for one in model.inputs] or ["x"], chance.choice(LANGUAGES)
    with np.errstate(all="ignore"):
        _told(lambda: [*predicted_lines(model, table_of(model), "t.csv")])
        _told(
            lambda: [
                *predicted_lines(model, table_of(model), "t.csv", derivatives=True, interval=0.9)
            ]
        )
        _told(lambda: [*inverted_lines(model, table_of(model), "t.csv", chance.choice(inputs))])
        for to in LANGUAGES:
            where = grid if to in ("csv", "table") else None
            verify = to == wanted and number % 10 == 0
            _told(
                lambda to=to, where=where, verify=verify: exported(
                    model, to, grid=where, verify=verify
                )
            )
    return "used"


def _told(command):
    """Run a command, which may refuse, but not with exit 1."""
    try:
        command()
    except MapmoreError as error:
        if error.exit_code == 1:
            raise


TARGET = Target(
    "forged",
    attempt,
    past=("used", "refused (exit 4)"),
    longest=60,
    warm=exports._warm,
)
