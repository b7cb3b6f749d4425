from __future__ import annotations

import math

import pytest

from mapmore_cli.domain.recording import Quantity
from mapmore_cli.domain.scores import Score
from mapmore_cli.reporting.score_tables import verdict

FORCE = Quantity("force", "N")


def score(model: str, nrmse: float, split: str = "validate", curve: str = "all") -> Score:
    return Score(model, "force", split, curve, 10, nrmse * 100, nrmse, 100.0, f"max|force| over {split}", 1.0, 0.01, 0.9)


def test_better_than_the_best_of_the_others():
    text = verdict([score("mapmore", 0.02), score("sarosi", 0.025), score("poly", 0.07)], "mapmore", FORCE)
    assert text == (
        "mapmore predicts force with an NRMSE of 2 % (RMSE 2 N) on the held-out data; "
        "the best competitor (Sárosi) reaches 2.5 %: mapmore is better (0.8 times the RMSE)."
    )


def test_worse_is_said_to_be_worse():
    assert "mapmore is worse (2 times the RMSE)" in verdict([score("mapmore", 0.02), score("sarosi", 0.01)], "mapmore", FORCE)


def test_nearly_equal_is_no_victory():
    text = verdict([score("mapmore", 0.01999), score("sarosi", 0.02)], "mapmore", FORCE)
    assert "no difference to speak of" in text
    assert "better" not in text


def test_training_errors_are_called_by_their_name():
    text = verdict([score("mapmore", 0.02, "train"), score("sarosi", 0.03, "train")], "mapmore", FORCE)
    assert "nothing was held out" in text


def test_a_good_training_error_does_not_hide_a_bad_validation_error():
    scores = [score("mapmore", 0.001, "train"), score("sarosi", 0.02, "train"), score("mapmore", 0.05), score("sarosi", 0.02)]
    assert "worse" in verdict(scores, "mapmore", FORCE)


def test_a_curve_by_itself_does_not_count():
    assert "worse" in verdict([score("mapmore", 0.02), score("sarosi", 0.01), score("mapmore", 0.0001, curve="p=1")], "mapmore", FORCE)


@pytest.mark.parametrize(
    ("others", "failed", "said"),
    [
        ([], (), "compared with no other model"),
        ([], ("sarosi",), "no competitor gave a prediction"),
        ([score("sarosi", math.nan)], (), "no competitor gave a prediction"),
    ],
)
def test_without_a_usable_competitor(others, failed, said):
    assert said in verdict([score("mapmore", 0.02), *others], "mapmore", FORCE, failed)


@pytest.mark.parametrize("scores", [[], [score("mapmore", math.nan)], [score("sarosi", 0.1)]])
def test_own_model_without_a_score(scores):
    assert verdict(scores, "mapmore", FORCE) == "mapmore gave no prediction."


def test_a_perfect_competitor():
    assert verdict([score("mapmore", 0.02), score("exact", 0.0)], "mapmore", FORCE).endswith("reaches 0 %: mapmore is worse.")


def test_repeatability_is_told_and_is_no_competitor():
    text = verdict([score("mapmore", 0.02), score("sarosi", 0.04), score("repeatability", 0.01)], "mapmore", FORCE)
    assert text.endswith(
        "the best competitor (Sárosi) reaches 4 %: mapmore is better (0.5 times the RMSE); repeated measurements differ by 1 %."
    )
    assert "compared with no other model" in verdict([score("mapmore", 0.02), score("repeatability", 0.01)], "mapmore", FORCE)
