"""A score: the mean absolute percentage error."""

SCORES = "domain/scores.py"
END = "    @classmethod\n    def of(cls, model: str"
BEGIN = '    mape: Annotated[float, "mean absolute error as a fraction of what was measured"'
FORMULA = """, Measure(
        lambda row: row.total(lambda block: np.abs(block.error / block.measured)) / row.n,
        "MAPE [%] .2f",
    )"""
REST = f"] = math.nan\n\n{END}"
PATCH = {SCORES: [(END, BEGIN + FORMULA + REST)]}
WORKS = """
from mapmore_cli.domain.compared import SampleBlock, Compared, Normaliser
from mapmore_cli.domain.scores import METRICS, Score
from mapmore_cli.reporting.score_tables import score_table
from mapmore_cli.study.schema import reference
y, p = np.array([1.0, 2.0]), np.array([1.1, 2.2])
row = Score.of("m", "force", "validate", "all", Compared(lambda: [SampleBlock(y, *[y, p, p, p, p])],
    Normaliser("scale", 2.0)))
assert abs(row.mape - 0.1) < 1e-12
assert "MAPE [%]" in [column.heading for column in score_table([row], {"force": "N"}).columns]
assert "| `mape` | mean absolute error as a fraction" in reference()
"""
ROOM = "modelling/scores/test_metrics.py::"
HALVES = {
    "whose unit is only in its heading": (
        {SCORES: [(END, BEGIN + FORMULA.replace("[%] .2f", "[UNIT]") + REST)]},
        f"{ROOM}test_headings_name_the_unit_and_a_limit_is_on_the_better_side",
    ),
    "without its formula": ({SCORES: [(END, BEGIN + REST)]}, "an import"),
    "which no test knows": (PATCH, f"{ROOM}"
        "test_numbers_of_long_recordings_are_those_of_whole_arrays"),
}  # fmt: skip
