"""`mapmore tune`: settings against each other by training data alone."""

import numpy as np
from cli_samples import write_recording, write_study

LEVELS = (100, 200, 300, 400, 500, 600)


def write_bench(folder):
    """Six pressures; the force is straight on both sides of a kink in the middle, slightly
    noisy.
    """
    spec = write_study(folder, levels=LEVELS, held_out=(300,))
    spec.write_text(spec.read_text() + "fit: {max_terms: 2}\n")
    rng, strain = np.random.default_rng(5), np.linspace(0.0, 0.2, 40)
    for level in LEVELS:
        force = level * (1 - 4 * strain - 3 * np.maximum(strain - 0.1, 0)) + rng.normal(
            0, 0.2, strain.size
        )
        write_recording(folder, "bench", level, strain, force)
    return spec


def test_the_simplest_that_is_as_good_as_the_best_is_named(tmp_path, document):
    spec = write_bench(tmp_path)
    over = ("--over", "fit.max_terms=1,2,4", "--over", "segment.strain.count=1,2")
    found = document("tune", spec, "-q", *over)
    assert found["left_out"] == "each of the 3 inner training levels of pressure"
    trials = {
        (one["set"]["fit.max_terms"], one["set"]["segment.strain.count"]): one
        for one in found["trials"]
    }
    assert trials[1, 1]["parameters"] == 5  # five training levels of one term
    within = [
        one
        for one in found["trials"]
        if one["above_best"] <= np.clip(one["standard_error"], 0.02, 0.18)
    ]
    chosen = next(one for one in found["trials"] if one["set"] == found["chosen"])
    assert chosen["parameters"] == min(one["parameters"] for one in within)
    assert trials[4, 1]["above_best"] > trials[4, 1]["standard_error"]  # a polynomial has no kink
    assert found["chosen"]["segment.strain.count"] == 2
    assert found["set"] == [f"{key}={value}" for key, value in found["chosen"].items()]


def test_a_combination_that_cannot_be_fitted_is_told_and_the_rest_goes_on(tmp_path, mapmore):
    spec = write_bench(tmp_path)
    result = mapmore("tune", spec, "--over", "segment.strain.count=2,50", code=0)
    assert "failed: segment.strain.count=50: " in result.stdout
    alone = ("tune", spec, "--over", "segment.strain.count=50")
    mapmore(*alone, code=5, says="no combination could be fitted")
