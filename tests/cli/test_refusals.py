"""What commands refuse: each line ends with its code and says what is wrong, no traceback, and
nothing is written.
"""

import shlex

import h5py
import pytest
from cli_samples import edit
from common import rows_of

import mapmore_cli
from mapmore_cli.domain.errors import DataError

LINES = """
2  run                                       CONFIG
2  rum SPEC                                  rum
2  run SPEC --no-such-option                 no-such-option
2  run SPEC -q -v                            exclude each other
3  run none.yaml                             none.yaml
2  batch SPEC --jobs 0                       greater than or equal to 1
2  batch SPEC --cluster tcp://host:1 --cluster-file x.json  exclude each other
2  simulate rig.yaml                         no longer exists
7  example .                                 is not an empty folder
4  freeze . --tag x --archive archive        is not a finished run
2  freeze RUN --tag ../x --archive archive   cannot be used as a tag
2  tune SPEC --runs RUNS --over fit.max_terms  not of the form KEY=V1,V2
2  tune SPEC --runs RUNS --over fit.max_terms=  not of the form KEY=V1,V2
2  tune SPEC --runs RUNS --over 'fit.max_terms=[1'  --over fit.max_terms
2  tune SPEC --runs RUNS --over fit.max_terms=1 --over fit.max_terms=2  given twice
2  tune SPEC --runs RUNS --over data.levels.within=1,2  changes the data
3  tune SPEC --runs RUNS --over fit.max_termz=1,2  max_terms
2  tune SPEC --runs RUNS --over fit.max_terms=1,2 -o x.jpeg  cannot have this file ending
2  tune SPEC --runs RUNS -o x.svg            a search has no figure
2  tune SPEC --runs RUNS --over fit.max_terms=1,2 --budget 5s  give one of the two
2  tune SPEC --runs RUNS --over fit.max_terms=1,2 --budget 3  --budget limits a search
2  plan SPEC --runs RUNS --until much        is not a half width
2  plan SPEC --runs RUNS --until -1%         is not a half width
2  plan SPEC --runs RUNS --cost pressure     is not of the form
2  plan SPEC --runs RUNS --cost force=3      the plan does not choose this
2  plan SPEC --runs RUNS -o plan.doc         cannot have this file ending
2  plan SPEC --runs RUNS --points 0          greater than or equal to 1
3  report SPEC --runs RUNS --figures fitt   report.figures
2  figure RUN fat -o x.pdf                   choose one of data, fit
2  figure RUN bands -o x.pdf                 residuals, nrmse, segments, terms
2  figure RUN fit -o x.docx                  choose .svg
2  figure RUN fit --curve 201 -o x.pdf       pressure=200
2  figure RUN fit -o x.svg --data x.csv      name its curve with --curve
2  figure RUN fit -o x.svg --models plane,parrot  no model called 'parrot'
2  figure RUN fit -o x.svg --set fit.max_terms=1  set a key of report.style
3  figure RUN fit -o x.svg --set report.style.widht=80mm  did you mean `width`
4  figure no-run fit -o x.pdf --runs .       does not contain a finished run
2  export MODEL -o out --to py --float       --float works with --to c only
2  export MODEL -o out --to fmu --float      --float works with --to c only
2  export MODEL -o out --to csv              --to csv needs --grid
2  export MODEL -o out --to c --grid strain=0.1  --grid works with --to csv and --to table only
2  export MODEL -o out --to csv --grid pressure=0:90000:100,strain=0.1  \
    outside of the training range
2  export MODEL -o out --to table --grid pressure=1           --grid: no values for strain
2  export MODEL -o out --to table --grid strain=1,pressure=1  --grid: pressure has a single point
2  export MODEL -o out --to java             java
7  export MODEL -o t.csv/out --to c          cannot be written
7  export MODEL -o t.csv/out --to fmu        cannot be written
7  export MODEL -o t.csv/out --to py         cannot be written
2  compare bench --runs RUNS                 needs two models
4  compare bench fourth --runs RUNS          there is no model with this name
2  compare bench bench --runs RUNS --fail-on drift  neither `changed`
2  compare bench bench --runs RUNS --fail-on -0.1  nor a relative change
2  compare bench bench --runs RUNS --fail-on nan   nor a relative change
2  compare bench bench --runs RUNS --fail-on inf   nor a relative change
2  compare bench bench --runs RUNS --fail-on '3 %'  nor a relative change
2  compare bench bench --runs RUNS --figure x.docx  .svg
2  predict MODEL                             either a TABLE or --grid
2  predict MODEL t.csv --grid pressure=100,strain=0  either a TABLE or --grid
2  predict MODEL --grid pressure=1 --as pressure     --as needs a TABLE
2  predict MODEL t.csv --as pressure --derivatives   --as needs a TABLE
2  predict MODEL t.csv --as pressure --interval 0.9  --as needs a TABLE
2  predict MODEL t.csv --as force            --as: the model has no input 'force'
2  predict MODEL t.csv --set force=1         the model has no input 'force'
2  predict MODEL t.csv --set pressure=x      --set pressure=x:
7  predict MODEL --grid pressure=100,strain=0 -o none/out.csv  cannot be written
7  predict MODEL --grid pressure=100,strain=0 -o .  cannot be written
4  predict none.h5 --grid pressure=100,strain=0  none.h5
4  predict RUN/fit.h5 --grid pressure=100,strain=0  fit.h5
4  predict RUN/scores.csv --grid pressure=100,strain=0  scores.csv
2  clean SPEC --runs . --now                 --now needs --yes
2  clean SPEC --runs none                    none: this folder does not exist
2  invert MODEL t.csv --for volume           no input 'volume'
4  show LONG                                 file name too long
4  init LONG                                 file name too long
4  example LONG                              file name too long
4  compare LONG LONG                         file name too long
4  predict LONG t.csv                        file name too long
4  invert --for pressure LONG t.csv          file name too long
4  export LONG --to c                        file name too long
4  invert MODEL LONG --for pressure          file name too long
4  freeze LONG --tag a                       file name too long
"""
"""Exit code, command line, and words of the message."""


@pytest.mark.parametrize(("code", "line", "words"), rows_of(LINES), ids=lambda cell: cell[:60])
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
    assert mapmore(*shlex.split(line), code=int(code), says=words).stdout == ""
    assert [path.name for path in tmp_path.iterdir()] == ["t.csv"]


NEWER = (
    "predict MODEL TABLE -o out",
    "show MODEL",
    "export MODEL --to fmu -o out",
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
