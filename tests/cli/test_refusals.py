"""What commands refuse: each line ends with its code and says what is wrong, no traceback, and
nothing is written.
"""

import shlex

import h5py
import pytest
from cli_samples import edit

import mapmore_cli
from mapmore_cli.domain.errors import DataError

GRID = "--grid pressure=100,strain=0"
TUNE, FIGURE, EXPORT = "tune SPEC --runs RUNS", "figure RUN", "export MODEL -o out --to"
LINES = [
    ("run", 2, "CONFIG"),
    ("rum SPEC", 2, "rum"),
    ("run SPEC --no-such-option", 2, "no-such-option"),
    ("run SPEC -q -v", 2, "exclude each other"),
    ("run none.yaml", 3, "none.yaml"),
    ("batch SPEC --jobs 0", 2, "greater than or equal to 1"),
    ("batch SPEC --cluster tcp://host:1 --cluster-file x.json", 2, "exclude each other"),
    ("simulate SPEC", 3, "bench.yaml"),
    ("example .", 7, "is not an empty folder"),
    ("freeze . --tag x --archive archive", 4, "is no finished run"),
    ("freeze RUN --tag ../x --archive archive", 2, "cannot be a tag"),
    (f"{TUNE} --over fit.max_terms", 2, "not of the form KEY=V1,V2"),
    (f"{TUNE} --over fit.max_terms=", 2, "not of the form KEY=V1,V2"),
    (f"{TUNE} --over 'fit.max_terms=[1'", 2, "--over fit.max_terms"),
    (f"{TUNE} --over fit.max_terms=1 --over fit.max_terms=2", 2, "given twice"),
    (f"{TUNE} --over data.levels.within=1,2", 2, "changes the data"),
    (f"{TUNE} --over fit.max_termz=1,2", 3, "max_terms"),
    (f"{TUNE} --over fit.max_terms=1,2 -o x.jpeg", 2, "neither a figure nor a table"),
    (f"{TUNE} -o x.svg", 2, "a search has no figure"),
    (f"{TUNE} --over fit.max_terms=1,2 --budget 5s", 2, "give one of both"),
    ("plan SPEC --runs RUNS --until much", 2, "is no size"),
    ("plan SPEC --runs RUNS --until -1%", 2, "is no size"),
    ("plan SPEC --runs RUNS --cost pressure", 2, "is no price"),
    ("plan SPEC --runs RUNS --cost force=3", 2, "the plan does not set it"),
    ("plan SPEC --runs RUNS -o plan.doc", 2, "neither a figure nor a table"),
    ("plan SPEC --runs RUNS --points 0", 2, "greater than or equal to 1"),
    (f"{FIGURE} fat -o x.pdf", 2, "choose one of data, fit"),
    (f"{FIGURE} fit -o x.docx", 2, "choose .svg"),
    (f"{FIGURE} fit --curve 201 -o x.pdf", 2, "pressure=200"),
    (f"{FIGURE} fit -o x.svg --data x.csv", 2, "--curve"),
    (f"{FIGURE} fit -o x.svg --models plane,parrot", 2, "no model called 'parrot'"),
    (f"{FIGURE} fit -o x.svg --set fit.max_terms=1", 2, "set a key of report.style"),
    (f"{FIGURE} fit -o x.svg --set report.style.widht=80mm", 3, "did you mean `width`"),
    ("figure no-run fit -o x.pdf --runs .", 4, "holds no finished run"),
    (f"{EXPORT} py --float", 2, "--float is for C alone"),
    (f"{EXPORT} fmu --float", 2, "--float is for C alone"),
    (f"{EXPORT} csv", 2, "--grid goes with --to csv"),
    (f"{EXPORT} csv --grid pressure=0:90000:100,strain=0.1", 2, "outside of the training range"),
    (f"{EXPORT} java", 2, "java"),
    *(
        (f"export MODEL -o t.csv/out --to {to}", 7, "cannot be written")
        for to in ("c", "fmu", "py")
    ),
    ("compare bench --runs RUNS", 2, "needs two models"),
    ("compare bench fourth --runs RUNS", 4, "there is no model of this name"),
    ("compare bench bench --runs RUNS --fail-on drift", 2, "neither `changed`"),
    ("compare bench bench --runs RUNS --figure x.docx", 2, ".svg"),
    ("predict MODEL", 2, "either a TABLE or --grid"),
    (f"predict MODEL t.csv {GRID}", 2, "either a TABLE or --grid"),
    (f"predict MODEL {GRID} -o none/out.csv", 7, "cannot be written"),
    (f"predict MODEL {GRID} -o .", 7, "cannot be written"),
    (f"predict none.h5 {GRID}", 4, "none.h5"),
    (f"predict RUN/fit.h5 {GRID}", 4, "fit.h5"),
    (f"predict RUN/scores.csv {GRID}", 4, "scores.csv"),
    ("invert MODEL t.csv --for volume", 2, "no input 'volume'"),
    *(
        (f"{line} LONG", 4, "file name too long")
        for line in ("show", "init", "example", "compare LONG")
    ),
    *(
        (f"{line} t.csv", 4, "file name too long")
        for line in ("predict LONG", "invert --for pressure LONG")
    ),
    ("export LONG --to c", 4, "file name too long"),
    ("invert MODEL LONG --for pressure", 4, "File name too long"),
    ("freeze LONG --tag a", 4, "file name too long"),
]


@pytest.mark.parametrize(("line", "code", "words"), LINES, ids=[line for line, _, _ in LINES])
def test_what_is_refused(line, code, words, finished, model_file, tmp_path, mapmore, monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    (tmp_path / "t.csv").write_text("force,pressure,strain\n100,150,0.05\n")
    places = {
        "SPEC": finished[0],
        "RUNS": finished[1],
        "RUN": finished[1] / "bench",
        "MODEL": model_file,
        "LONG": "x" * 300,
    }
    for name, place in places.items():
        line = " ".join(
            word.replace(name, str(place), 1) if word.split("/")[0] == name else word
            for word in line.split(" ")
        )
    assert mapmore(*shlex.split(line), code=code, says=words).stdout == ""
    assert [path.name for path in tmp_path.iterdir()] == ["t.csv"]


NEWER = (
    *(
        "predict MODEL TABLE -o out",
        "invert MODEL TABLE --for pressure -o out",
        "show MODEL",
        "compare MODEL MODEL --figure out.svg",
    ),
    *(f"export MODEL --to {to} -o out" for to in ("c", "py", "fmu")),
    "validate SPEC --runs others",
)


@pytest.mark.parametrize("command", NEWER)
def test_a_model_of_a_newer_format_is_refused_by_whatever_reads_one(
    command, copied, tmp_path, mapmore
):
    spec, runs = copied
    model = runs / "bench" / "model.h5"
    with h5py.File(model, "a") as file:
        file.attrs["format_version"] = "4.0"
    (tmp_path / "table.csv").write_text("pressure,strain,force\n150,0.02,100\n")
    edit(spec, "[polynomial_2]", "[{model: runs/bench/model.h5, as: other}]")
    places = {"MODEL": model, "TABLE": "table.csv", "SPEC": spec}
    line = [places.get(word, word) for word in command.split()]
    mapmore(*line, code=4, says=["4.0", "newer", "update mapmore"])
    assert not [*tmp_path.glob("out*")]
    with pytest.raises(DataError, match=r"format 4\.0"):
        mapmore_cli.load_model(model)
