"""Every shipped study loads and runs; simulated ones give their scores, measured ones those of the
pages.

These are docs/measured-static.md and docs/memory.md.
"""

import json
import re

import jsonschema
import pytest
import yaml
from cli_samples import CONFIGS, held_out, options, without_figures
from common import rows_of
from page_tables import MEMORY, numbers, page_table

from mapmore_cli.study.loader import load

STUDIES = sorted(
    path
    for path in CONFIGS.rglob("*.yaml")
    if not path.name.startswith("_") and not {"campaigns", "papers"} & set(path.parts)
)
IN_FREE_RUN = ("cascaded_tanks", "bouc_wen")
"""Studies whose search takes minutes: see test_free_run_studies.py."""


def is_measured(path):
    """True for a study of recordings that are not part of the project, whose folder it or what it
    extends names.
    """
    text = path.read_text(encoding="utf-8")
    base = re.search(r"^extends: (\S+)", text, re.MULTILINE)
    return "MAPMORE_DATA" in text or (base is not None and is_measured(path.parent / base[1]))


ON_RATES = CONFIGS / "coiled" / "coiled_steps_rates.yaml"
"""A study of docs/damping.md: see test_motion_studies.py."""
MEASURED = [
    path
    for path in STUDIES
    if path.stem not in IN_FREE_RUN and path != ON_RATES and is_measured(path)
]
CHAINED = [
    path
    for path in STUDIES
    if any(word in path.stem for word in ("-damping", "-dynamic", "-from-zero"))
]
"""Studies that one run of a dynamic study makes: see test_motion_studies.py."""
FOUND = [path for path in STUDIES if path.stem.endswith("-found")]
"""Those of `make demo`: see test_search_page.py."""
WITH_PAGE = [path for path in STUDIES if path.parent.name in ("wrist", "muscle-like")]
"""Studies that a page of their own is about: see test_muscle_pages.py."""
ELSEWHERE = [
    path
    for path in STUDIES
    if path == ON_RATES or path in (*CHAINED, *FOUND, *WITH_PAGE) or path.stem in IN_FREE_RUN
]
SIMULATED = [path for path in STUDIES if path not in MEASURED and path not in ELSEWHERE]


def errors_of(models):
    """The errors of models, by their names."""
    return {name: float(error) for name, error in map(str.split, models)}


NRMSE = {
    study: errors_of(models)
    for study, *models in rows_of("""
lever-tip  mapmore 0.0088  cubic 0.0106
dmsp-20-88-static  mapmore 0.0170  sarosi 0.0092  polynomial_2 0.0346
dmsp-20-88-weighed  mapmore 0.0160  sarosi 0.0092  polynomial_2 0.0346
peano-static  mapmore 0.0091  sarosi 0.0144  polynomial_2 0.0410
dmsp-20-88-m1-static  mapmore 0.0197  two_terms 0.0275  sarosi 0.0139  polynomial_5 0.4083  \
    polynomial_5_nominal 2.0720
peano-m1-static  mapmore 0.0194  two_terms 0.0101  sarosi 0.0144  polynomial_5 0.1995  \
    polynomial_5_nominal 1.1641
dmsp-20-88-m1-hysteresis  mapmore 0.1590  one_term 4.3463  sarosi 0.0856
dmsp-20-88-perturbation  mapmore 0.1186  none 0.2358
dmsp-20-88-cycles  mapmore 0.0272  sarosi 0.0276
peano-cycles  mapmore 0.0182  sarosi 0.0255
peano-perturbation  mapmore 0.2714  none 0.4244
peano-m1-hysteresis  mapmore 0.1010  sarosi 0.0870
dmsp-20-88-inner-reversals  mapmore 0.0055  static 0.0176  rise_and_fall 0.0082  \
     prandtl_ishlinskii 0.0242
peano-inner-reversals  mapmore 0.0032  static 0.0164  rise_and_fall 0.0062  \
     prandtl_ishlinskii 0.0280
dmsp-20-400-sections  mapmore 0.1079  shared_state 0.1009
dmsp-20-400-loads  mapmore 0.0686  without_load 0.0722  sections 0.0542  sections_load 0.0483  \
     placed_load 0.0413
dmsp-20-400-read-again  mapmore 0.0827  linear 0.0863  piecewise 0.0918  \
     piecewise_inflate_deflate 0.1220
dmsp-20-400-waveforms  mapmore 0.0827  linear_least_squares 0.0855  linear 0.1016  \
     shared_state 0.1886
""")
}
"""Validation scores on the committed recordings; a change of these is a change of numbers and
belongs in the changelog.
"""

WITH_REPORT = (
    *("dmsp-20-88-static", "peano-m1-hysteresis"),
    *("festo_10mm_10cm_pressure", "pgm_force", "coiled_loops", "buck", "antagonist-pam"),
)
"""Studies whose page is made as well, one of each kind; test_motion_studies.py makes that of a
damping study.
"""

LONG = re.compile(
    r"festo_10mm_.*|bellows_.*|coiled_.*_motion|coiled_loads|coiled_steps|emps|antagonist_pam|"
    r"pgm_force"
)
"""Measured studies with the competitors of others, which take most of the time; `test_memory_page`
runs another record of some.
"""

SHORT = {
    **dict.fromkeys(
        ("festo_10mm_10cm_pressure", "festo_10mm_10cm_repeat", "bellows_raw", "bellows_strain"),
        "sarosi",
    ),
    "festo_10mm_family": "",
    "coiled_steps_motion": (
        "{as: inflate_deflate, set: {model: {type: state_space, input: pressure, offset: "
        "true, direction: true}}}"
    ),
}
"""Some of them, one of each split, which are run with one competitor or none. The model of
coiled_loops_motion is that of coiled_loops.
"""

LONG_SIMULATED = (
    *("dmsp-20-400-waveforms", "dmsp-20-400-read-again", "peano-perturbation"),
    *("dmsp-20-88-cycles", "peano-cycles", "dmsp-20-88-weighed", "peano-inner-reversals"),
)
"""Their competitors are other models of motion, as those of dmsp-20-400-sections;
peano-perturbation is as dmsp-20-88-perturbation, dmsp-20-88-weighed as dmsp-20-88-static, and
peano-inner-reversals as that of the other muscle; the cycles are long records.
"""

SCORED = {"festo_10mm_family": "family", "printed_cylinder": "cylinder"}
"""Studies whose score table is on docs/measured-static.md."""

IN_CAMPAIGNS = {
    "coiled_loops": ("coiled", "loops-1-200g"),
    "coiled_steps": ("coiled", "steps-1-200g"),
    "coiled_loads": ("coiled_other_load", "loads-1-200g-from-100g-300g"),
}
"""Studies that a campaign runs by another name: table and row of docs/memory.md."""

IN_MOTION = {
    "coiled_steps_motion": "motion-steps-1-200g",
    "coiled_loops_motion": "motion-loops-1-200g",
}
"""The same in docs/motion.md."""


def names(paths):
    return [path.stem for path in paths]


def test_there_are_studies_of_both_kinds():
    assert len(SIMULATED) >= 2
    assert len(MEASURED) >= 3


def test_no_shipped_campaign_writes_into_the_folder_of_a_study():
    campaigns = {
        yaml.safe_load(path.read_text(encoding="utf-8"))["campaign"]
        for path in (CONFIGS / "campaigns").glob("*.yaml")
    }
    assert campaigns
    assert campaigns.isdisjoint(load(path).name for path in STUDIES)


@pytest.fixture(scope="module")
def schema():
    return jsonschema.Draft202012Validator(
        json.loads((CONFIGS / "experiment.schema.json").read_text(encoding="utf-8"))
    )


@pytest.mark.parametrize("path", STUDIES, ids=names(STUDIES))
def test_a_study_is_named_after_its_file_and_follows_the_schema(path, schema):
    loaded = load(path)
    assert loaded.spec.name == path.stem
    assert ("/datasets/" not in loaded.resolved) == is_measured(path)
    modeline = (
        path.read_text(encoding="utf-8")
        .splitlines()[0]
        .removeprefix("# yaml-language-server: $schema=")
    )
    assert (path.parent / modeline).resolve() == CONFIGS / "experiment.schema.json"
    schema.validate(yaml.safe_load(loaded.resolved))


def run(document, path, runs, *settings, with_report):
    spec = without_figures(path, runs) if "needs:" in path.read_text(encoding="utf-8") else path
    command = "run" if with_report else "validate"
    found = document(command, spec, "--runs", runs, "-q", *settings)
    assert (runs / path.stem / "report" / "index.html").is_file() == with_report
    return held_out(found)


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(
            path, marks=pytest.mark.long if path.stem in LONG_SIMULATED else (), id=path.stem
        )
        for path in SIMULATED
    ],
)
def test_a_simulated_study_gives_its_scores(path, tmp_path, document):
    rows = run(document, path, tmp_path, with_report=path.stem in WITH_REPORT)
    for model, nrmse in NRMSE[path.stem].items():
        assert rows[model]["nrmse"] == pytest.approx(nrmse, abs=1e-4, rel=5e-3)


def test_a_long_simulated_study_runs_alone(tmp_path, document):
    (path,) = (path for path in SIMULATED if path.stem == LONG_SIMULATED[0])
    rows = run(document, path, tmp_path, "--set", "validate.against=[]", with_report=False)
    assert rows["mapmore"]["nrmse"] == pytest.approx(
        NRMSE[LONG_SIMULATED[0]]["mapmore"], abs=1e-4, rel=5e-3
    )


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A folder of runs, where one study finds another that it is compared with."""
    return tmp_path_factory.mktemp("runs")


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(
            path, marks=pytest.mark.long if LONG.fullmatch(path.stem) else (), id=path.stem
        )
        for path in MEASURED
    ],
)
def test_a_measured_study_runs(path, runs, document, measured_data):
    rows = run(document, path, runs, with_report=path.stem in WITH_REPORT)
    assert 0 < rows["mapmore"]["nrmse"] < 0.6
    assert rows["mapmore"]["n"] >= 10
    told = shown_of(path.stem)
    assert not told or set(told) == set(rows)
    assert_told(told, rows)
    identification = page_table("identification", MEMORY)
    if path.stem in identification:
        row = numbers(identification[path.stem])
        told_of_runs = (row["RRSE, free run"], row["RRSE, one step"])
        assert (rows["mapmore"]["rrse"], rows["mapmore"]["rrse_one_step"]) == pytest.approx(
            told_of_runs, abs=2e-5
        )


QUICK = ("bellows_strain", "coiled_steps_motion")
"""Of the short ones those that `make test` runs."""


@pytest.mark.parametrize(
    ("study", "competitor"),
    [
        pytest.param(*one, marks=() if one[0] in QUICK else pytest.mark.long, id=one[0])
        for one in SHORT.items()
    ],
)
def test_a_long_measured_study_runs_almost_alone(
    study, competitor, tmp_path, document, measured_data
):
    (path,) = (path for path in MEASURED if path.stem == study)
    rows = run(
        document,
        path,
        tmp_path,
        *options(f"validate.against=[{competitor}]", "validate.simple=false"),
        with_report=False,
    )
    assert 0 < rows["mapmore"]["nrmse"] < 0.6
    assert_told(
        {model: per_cent for model, per_cent in shown_of(study).items() if model in rows}, rows
    )
    assert rows.keys() - shown_of(study).keys() == (
        rows.keys() if study == "bellows_raw" else set()
    )


def assert_told(told, rows):
    """The errors of a run are those of a page, in per cent."""
    for model, per_cent in told.items():
        assert 100 * rows[model]["nrmse"] == pytest.approx(per_cent, rel=0.02), model


def shown_of(study):
    """NRMSE in per cent by model, as docs/measured-static.md or docs/memory.md has it; empty for a
    study that neither shows.
    """
    if study in SCORED:
        return {model: float(row["NRMSE"]) for model, row in page_table(SCORED[study]).items()}
    if study in IN_CAMPAIGNS:
        table, row = IN_CAMPAIGNS[study]
        return numbers(page_table(table, MEMORY)[row])
    if study in IN_MOTION:
        return numbers(page_table("coiled_motion", MEMORY.with_name("motion.md"))[IN_MOTION[study]])
    return numbers(page_table("measured").get(study, {}))
