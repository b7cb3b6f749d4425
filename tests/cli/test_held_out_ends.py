"""A search on the shipped example, with the complete list of structures, if an outer level is held
out.
"""

import pytest


@pytest.mark.long
@pytest.mark.parametrize("pressure", [80, 500])
def test_a_search_that_holds_out_an_outer_level_is_as_good_as_a_formula(
    pressure, tmp_path, mapmore, document
):
    mapmore("example", "muscle", code=0)
    spec = tmp_path / "outer.yaml"
    split = f"data: {{split: {{validate: {{pressure: [{pressure}]}}}}}}"
    spec.write_text(f"extends: muscle/search.yaml\nname: outer\n{split}\n")
    scores = document("run", spec, "-q")["scores"]
    nrmse = {row["model"]: row["nrmse"] for row in scores if row["split"] == "validate"}
    assert nrmse["mapmore"] <= 1.01 * nrmse["sarosi"]
