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


def printed(model):
    view = VIEWS["model"](model)
    return "\n".join([*map(to_text, view.tables), *view.lines])


def rows(text, heading):
    """Cells below the rule of the table whose columns begin so."""
    lines = text[re.search(rf"^{heading}", text, re.MULTILINE).start() :].splitlines()
    head = re.split(r"\s{2,}", lines[0])
    body = lines[2 : lines.index("") if "" in lines else None]
    return [dict(zip(head, re.split(r"\s{2,}", line), strict=True)) for line in body]


def weight_and_place(words, x, rise):
    """The weight of a piece at x, and where its equation is evaluated."""
    weight, place = 1.0, dict(x)
    for own in filter(None, words.split("; ")) if words != "–" else ():
        name, told = own.split(" ", 1)
        for verb, first, last in re.findall(r"(rises|falls) (\S+) to ([^,\s]+)", told):
            t = np.clip((x[name] - float(first)) / (float(last) - float(first)), 0, 1)
            weight *= rise(t) if verb == "rises" else 1 - rise(t)
        for side, edge in re.findall(r"held (below|above) ([^,\s]+)", told):
            place[name] = (max if side == "below" else min)(place[name], float(edge))
    return weight, place


def transition(text):
    told = re.search(r"; w = (.*?)(?: up to t = 1/2, then (.*?))?, t from", text)
    low, high = told[1], told[2] or told[1]
    return lambda t: float(evaluate(parse(low if t <= 0.5 else high), {"t": np.array([t])})[0])


def computed(text, x):
    """The output at one point of the inputs, by name."""
    pieces, limits, rise = rows(text, "piece"), rows(text, "curve  "), transition(text)
    at = lambda piece, place: float(  # noqa: E731
        read(piece["equation"], {name: np.array([value]) for name, value in place.items()})[0]
    )

    def of_curve(row):
        held = dict(x)
        for name in x:
            if f"{name}: beyond its limits it is held at the limit" in text:
                ends = [
                    float(v) for k, v in row.items() if k.startswith((f"{name} from", f"{name} to"))
                ]
                held[name] = np.clip(x[name], *ends)
        found = 0.0
        for piece in (one for one in pieces if one["piece"].startswith(f"{row['curve']}/")):
            weight, place = weight_and_place(piece.get("weight", "–"), held, rise)
            found += weight * at(piece, place) if weight else 0.0
        return found

    backbone = sum(at(one, x) for one in pieces if "/" not in one["piece"])
    values = np.array([of_curve(row) for row in limits])
    between = re.search(
        r"two levels of (\w+), at.*?(?:all times (\S+) \+ (\S+)\*\(1 - 2\*t\)\^2)?\.$", text, re.M
    )
    if between is None:
        return backbone + values[0]
    levels = [float(row["level [kPa]"]) for row in limits]
    place = np.clip(x[between[1]], levels[0], levels[-1])
    i = min(int(np.searchsorted(levels, place, side="right")), len(levels) - 1) - 1
    t = (place - levels[i]) / (levels[i + 1] - levels[i])
    share = float(between[2]) + float(between[3]) * (1 - 2 * t) ** 2 if between[2] else 1.0
    share = share if levels[0] < x[between[1]] < levels[-1] else 1.0
    return backbone + share * ((1 - t) * values[i] + t * values[i + 1])


SIDES = {"pressure": ("continue", "continue"), "strain": ("saturate", "saturate")}
CASES = {
    "as it comes": {},
    "quadratic": {"transition": "quadratic", "z_s": 0.4},
    "cubic and held": {
        "transition": "cubic",
        "extrapolation": SIDES,
        "cuts": {"strain": Cuts("breakpoints", at=(0.02, 0.11))},
    },
    "no levels, two variables": {
        "level": None,
        "cuts": {"strain": Cuts("even", 2), "pressure": Cuts("breakpoints", at=(200.0,))},
        "dictionary": ("1", "strain", "pressure", "strain*pressure", "strain^2"),
    },
}


@pytest.mark.parametrize("case", CASES)
def test_the_model_is_computed_from_its_print(case):
    model = built(**CASES[case])
    text = printed(model)
    rng = np.random.default_rng(3)
    x = {"pressure": rng.uniform(60, 380, 60), "strain": rng.uniform(0, 0.1, 60)}
    mine = [
        computed(text, dict(zip(x, point, strict=True))) for point in zip(*x.values(), strict=True)
    ]
    exact = predict(model, x)
    assert np.abs(np.array(mine) - exact).max() <= 2 * STATED * np.ptp(exact)


def test_on_a_backbone_of_which_a_share_is_carried():
    samples = curves(held_out=())
    pooled = {
        name: np.concatenate([one.columns[name] for one in samples])
        for name in ("pressure", "strain")
    }
    formula = get("polynomial_2").fit(pooled, force(pooled["pressure"], pooled["strain"]))
    model = built(samples, backbone=formula, extrapolation=SIDES)
    text = printed(model)
    assert "plus the pieces" in text
    x = {"pressure": np.linspace(60, 370, 40), "strain": np.linspace(0.08, 0.01, 40)}
    mine = [
        computed(text, dict(zip(x, point, strict=True))) for point in zip(*x.values(), strict=True)
    ]
    exact = predict(model, x)
    assert np.abs(np.array(mine) - exact).max() <= 2 * STATED * np.ptp(exact)
