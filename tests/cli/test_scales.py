"""A column may be scaled by any number: there is a result, or an error that says what is wrong with
the data or the fit.
"""

from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from mapmore_cli.domain.errors import DataError, FitError
from mapmore_cli.pipeline.runner import Options, bring_up_to_date
from mapmore_cli.study.loader import load

MODELS = (
    (),
    ("model={type: mapmore, backbone: sarosi_hinged}",),
    ("model={type: mapmore, backbone: sarosi}",),
    ("model={type: literature, name: tondu_lopez}", "segment={}", "dictionary=[]"),
    ("scaling=none",),
)


@settings(max_examples=10, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.sampled_from(["pressure", "strain", "force"]),
    st.floats(-300, 300),
    st.sampled_from([1.0, -1.0]),
    st.sampled_from(MODELS),
)
@example("strain", -300.0, 1.0, MODELS[1])
@example("force", 300.0, -1.0, MODELS[0])
@example("strain", -29.0, 1.0, MODELS[1])
@example("pressure", 27.0, 1.0, MODELS[1])
def test_any_scale_gives_a_result_or_says_what_is_wrong(
    study, tmp_path, name, exponent, sign, model
):
    own = ("data.levels.at=auto", "data.split={}") if name == "pressure" else ()
    loaded = load(
        study,
        (
            f"data.columns.{name}.scale={sign * 10.0**exponent!r}",
            *own,
            *(one for one in model if "scaling" not in one),
        ),
    )
    try:
        bring_up_to_date(loaded, tmp_path / "runs", options=Options(force=True, check=False))
    except (DataError, FitError) as fault:
        assert fault.remedy  # noqa: PT017 - most scales give a result
