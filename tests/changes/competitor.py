"""A competitor: nearest neighbours."""

LEARNERS = "modelling/learners.py"
TABLE = "LEARNERS: Mapping[str, Learner]"
ROW = '        "mlp": Learner('
MADE = """def _nearest_neighbours(_inputs: int) -> Regressor:
    from sklearn.neighbors import KNeighborsRegressor

    return KNeighborsRegressor(n_neighbors=1)


"""
DECLARED = '        "nearest": Learner("Nearest neighbours", 20_000, _nearest_neighbours),\n'
PATCH = {LEARNERS: [(TABLE, MADE + TABLE), (ROW, DECLARED + ROW)]}
WORKS = """
from mapmore_cli.fitting.baselines import learned
from mapmore_cli.reporting.table import title_of
x = np.arange(5.0)[:, None]
assert np.allclose(learned("nearest", x, x[:, 0] ** 2)(x + 0.1), x[:, 0] ** 2)
assert title_of("nearest") == "Nearest neighbours"
"""
HALVES = {
    "without a title": (
        {
            LEARNERS: [
                (TABLE, MADE + TABLE),
                (ROW, DECLARED.replace("Nearest neighbours", "") + ROW),
            ]
        },
        "fitting/test_baselines.py::test_learners_have_a_title_a_name_of_their_own_and_a_seed",
    ),
    "without its learner": ({LEARNERS: [(ROW, DECLARED + ROW)]}, "an import"),
    "that is not declared": (
        {LEARNERS: [(TABLE, MADE + TABLE)]},
        "fitting/test_baselines.py::test_every_learner_of_the_module_is_declared",
    ),
}
