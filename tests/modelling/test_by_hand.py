"""What `mapmore show` prints is the model: a program that reads nothing else computes the same."""

import re

import numpy as np
import pytest
from surfaces import built, curves, force
from test_equations import STATED, read

from mapmore_cli.cli.views import VIEWS
from mapmore_cli.modelling.expressions import evaluate, parse
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.literature import get
from mapmore_cli.modelling.pieces.recipe import Cuts
from mapmore_cli.reporting.table import to_text


def rows(text, heading):
    """Cells below the rule of the table whose columns begin so."""
    head, _, *lines = text[text.index(f"\n{heading}") + 1 :].splitlines()
    cells = (re.split(r"\s{2,}", line) for line in lines[: [*lines, ""].index("")])
    return [dict(zip(re.split(r"\s{2,}", head), line, strict=True)) for line in cells]


def weighted(piece, x, rise):
    """The value of a piece at x by its row: its weight times its equation, where that is held."""
    weight, place = 1.0, dict(x)
    for name, told in re.findall(r"(\w+) ((?:rises|falls|held)[^;]*)", piece.get("weight", "")):
        for verb, first, last in re.findall(r"(rises|falls) (\S+) to ([^,\s]+)", told):
            t = np.clip((x[name] - float(first)) / (float(last) - float(first)), 0, 1)
            weight *= rise(t) if verb == "rises" else 1 - rise(t)
        for side, edge in re.findall(r"held (below|above) ([^,\s]+)", told):
            place[name] = (max if side == "below" else min)(place[name], float(edge))
    columns = {name: np.array([value]) for name, value in place.items()}
    return weight * read(piece["equation"], columns)[0] if weight else 0.0


def computed(text, x):
    """The output at one point of the inputs, by name."""
    low, high = re.search(r"; w = (.*?)(?: up to t = 1/2, then (.*?))?, with t from", text).groups()
    rise = lambda t: evaluate(  # noqa: E731
        parse(low if t <= 0.5 else high or low), {"t": np.array([t])}
    )[0]
    pieces, values, levels = rows(text, "piece"), [], []
    for row in rows(text, "curve  "):
        held = {
            name: np.clip(value, float(row[f"{name} from"]), float(row[f"{name} to"]))
            if f"{name}: beyond its limits it is held at the limit" in text
            else value
            for name, value in x.items()
        }
        own = [one for one in pieces if one["piece"].startswith(f"{row['curve']}/")]
        values.append(sum(weighted(one, held, rise) for one in own))
        levels.append(float(row.get("level [kPa]", "nan")))
    backbone = sum(weighted(one, x, rise) for one in pieces if "/" not in one["piece"])
    if len(values) == 1:
        return backbone + values[0]
    place = np.clip(x["pressure"], levels[0], levels[-1])
    i = min(int(np.searchsorted(levels, place, side="right")), len(levels) - 1) - 1
    t = (place - levels[i]) / (levels[i + 1] - levels[i])
    carried = re.search(r"all times (\S+) \+ (\S+)\*\(1 - 2\*t\)\^2\.", text)
    share = float(carried[1]) + float(carried[2]) * (1 - 2 * t) ** 2 if carried else 1.0
    return backbone + share * ((1 - t) * values[i] + t * values[i + 1])


HELD = {"pressure": ("continue", "continue"), "strain": ("saturate", "saturate")}
CASES = {
    "as it comes": {},
    "quadratic": {"transition": "quadratic", "z_s": 0.4},
    "cubic and held": {
        "transition": "cubic",
        "extrapolation": HELD,
        "cuts": {"strain": Cuts("breakpoints", at=(0.02, 0.11))},
    },
    "no levels, two variables": {
        "level": None,
        "cuts": {"strain": Cuts("even", 2), "pressure": Cuts("breakpoints", at=(200.0,))},
        "dictionary": ("1", "strain", "pressure", "strain*pressure", "strain^2"),
    },
    "on a backbone": {"samples": curves(held_out=()), "extrapolation": HELD},
}


@pytest.mark.parametrize("case", CASES)
def test_the_model_is_computed_from_its_print(case):
    changes = dict(CASES[case])
    if samples := changes.get("samples"):
        p, e = (np.concatenate([one.columns[x] for one in samples]) for x in ("pressure", "strain"))
        changes["backbone"] = get("polynomial_2").fit({"pressure": p, "strain": e}, force(p, e))
    model = built(**changes)
    view = VIEWS["model"](model)
    text = "\n".join([*map(to_text, view.tables), *view.lines])
    rng = np.random.default_rng(3)
    x = {"pressure": rng.uniform(60, 380, 60), "strain": rng.uniform(0, 0.1, 60)}
    points = zip(*x.values(), strict=True)
    found = [computed(text, dict(zip(x, place, strict=True))) for place in points]
    exact = predict(model, x)
    assert np.abs(np.array(found) - exact).max() <= 2 * STATED * np.ptp(exact)
