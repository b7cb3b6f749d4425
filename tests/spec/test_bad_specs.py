"""Documents that must be refused: each with its place, what is wrong, and what would be right."""

from __future__ import annotations

from pathlib import Path

import pytest
from spec_examples import FORMULA, LOGS, MEASURED, STATIC, refusal, refuse_slip

# What the static study says, what it says instead with ▸ before the place of the mistake, words of message and remedy.
SLIPS = [
    # keys
    ("max_terms: 1", "▸max_term: 1", ["unknown key `max_term` in `fit`", "did you mean `max_terms`?"]),
    ("muscle:", "▸muskle:", ["unknown key `muskle`", "did you mean `muscle`?"]),
    ("unit: N}", "unit: N, ▸colour: red}", ["unknown key `colour` in `data.columns.force`", "did you mean `column`?"]),
    ("reader: csv", "▸xyz: 1", ["unknown key `xyz` in `data`", "known are `files`, `reader`"]),
    ("strain:   {column: eps}", "▸strain:   {unit: '1'}", ["`data.columns.strain` lacks the key `column`"]),
    ("{column: eps}", "{▸colum: eps}", ["unknown key `colum` in `data.columns.strain`", "did you mean `column`?"]),
    ("strain:   {column", "▸my strain: {column", ["'my strain' cannot be the name of a quantity", "letters, digits"]),
    # values of the wrong kind
    ("max_terms: 1", "max_terms: ▸one", ["`fit.max_terms` should be a whole number, but is the text 'one'"]),
    ("max_terms: 1,", "max_terms: ▸1.5,", ["should be a whole number, but is 1.5"]),
    ("max_terms: 1,", "max_terms: ▸0,", ["`fit.max_terms` should be at least 1, but is 0"]),
    ("max_terms: 1,", "max_terms: ▸true,", ["should be a whole number, but is true"]),
    ("max_terms: 1,", "max_terms: ▸\"1\",", ["the text '1'", "remove the quotes"]),
    ("tolerance: 1.0e-4", "tolerance: ▸1", ["should be less than 1, but is 1"]),
    ("tolerance: 1.0e-4", "tolerance: ▸.nan", ["should be a finite number"]),
    ("z_s: 0.25", "z_s: ▸0.75", ["should be at most 0.5, but is 0.75"]),
    ("length: 88 mm", "length: ▸-88 mm", ["`muscle.length` should be greater than 0"]),
    ("length: 88 mm", "length: ▸long", ["should be a number, but is the text 'long'"]),
    ("kind: mckibben", "kind: ▸3", ["`muscle.kind` should be text, but is 3", "put it in quotes"]),
    ("reader: csv", "header: ▸no", ["`data.header` should be true or false or a number, but is the text 'no'"]),
    ("[strain], order", "▸strain, order", ["should be a list, but is the text 'strain'", "write `[strain]`"]),
    ("fit:  {", "fit: ▸3 #{", ["`fit` should be a mapping, but is 3"]),
    ("fit:  {", "fit:▸ #{", ["`fit` should be a mapping, but is empty"]),
    ("name: dmsp-20-88-static", "name: ▸../up", ["`name` cannot be the text '../up'", "letter or digit"]),
    ("name: dmsp-20-88-static", "name: ▸12", ["`name` should be text, but is 12", "put it in quotes"]),
    ("schema_version: 1", "schema_version: ▸2", ["`schema_version` cannot be 2", "1"]),
    ("files: [", "files: ▸[] #", ["`data.files` is empty", "at least 1"]),
    ("files: [", "files: [▸7, ", ["`data.files[0]` should be text or a mapping, but is 7"]),
    # words
    ("target: static", "target: ▸statics", ["`target` cannot be the text 'statics'", "did you mean `static`?"]),
    ("target: static", "target: ▸[static]", ["`target` should be text or a mapping, but is a list"]),
    ("unit_square", "▸unitsquare", ["did you mean `unit_square`?"]),
    ("extrapolation: continue", "extrapolation: ▸hold", ["possible are `continue`, `continue_linear`, `saturate`, `zero`"]),
    ("extrapolation: continue", "extrapolation: {strain: {above: ▸zerro}}", ["did you mean `zero`?"]),
    ("[data, fit, error, nrmse]", "[data, ▸fits]", ["did you mean `fit`?"]),
    ("method: even, count: 4", "method: ▸evn, count: 4", ["did you mean `even`?"]),
    ("at: [80, 150, 250, 350]", "at: ▸autos", ["did you mean `auto`?"]),
    # keys of one section that do not fit each other
    ("method: even, count: 4", "▸method: even", ["method `even` needs `count`", "count: 4"]),
    ("method: even, count: 4", "▸method: breakpoints", ["method `breakpoints` needs `at`"]),
    ("method: even, count: 4", "method: breakpoints, ▸count: 4, at: [1]", ["has no use for `count`", "remove `count`"]),
    ("method: even, count: 4", "method: breakpoints, ▸at: [0.2, 0.1, 20 %]", ["do not increase", "[0.1, 0.2]"]),
    ("  cycles:", "  keep: [{▸quantity: strain}]\n  cycles:", ["`keep` has no condition", "give one of `abs_below`"]),
    ("  cycles:", "  keep: [{quantity: strain, below: 1, ▸above: 0}]\n  cycles:", ["two conditions", "`below`, `above`"]),
    ("  cycles:", "  keep: [{quantity: strain, ▸between: [1, 0]}]\n  cycles:", ["from 1 to 0", "lower end first"]),
    ("  cycles:", "  keep: [{quantity: strain, ▸outside: [1, 1]}]\n  cycles:", ["`outside` runs from 1 to 1", "lower end first"]),
    ("  cycles:", "  keep: [{quantity: strain, between: ▸[1]}]\n  cycles:", ["too few values", "[low, high]"]),
    ("  cycles:", "  keep: [{quantity: strain, between: ▸[1, 2, 3]}]\n  cycles:", ["too many values"]),
    ("350]}", "350], ▸within: 50}", ["levels overlap: they lie 70 apart", "35 or less"]),
    ("at: [80, 150, 250, 350]", "▸at: [80, 150, 250, 350, 1.5 bar]", ["level 150 is given twice", "give each level once"]),
    ("- polynomial: {of: [strain], order: 4}", "- ▸{}", ["no family of terms"]),
    ("- polynomial: {of: [strain], order: 4}", "- ▸{polynomial: {of: [strain], order: 4}, terms: [strain]}", ["two families"]),
    ("validate: {pressure: [250]}", "▸validate: {}", ["does not say what is held out"]),
    ("{pressure: [250]}", "{pressure: [250], ▸seed: 1}", ["`seed` draws nothing here", "`fraction`"]),
    ("{pressure: [250]}", "{▸last_cycles: 0.5}", ["`last_cycles` and `of` go together", "of: pressure"]),
    ("{pressure: [250]}", "{pressure: [250], ▸of: strain}", ["`last_cycles` and `of` go together"]),
    ("{pressure: [250]}", "{last_cycles: ▸2, of: strain}", ["should be less than 1"]),
    ("{pressure: [250]}", "{last_cycles: 0.5, of: ▸strian}", ["no quantity `strian`", "did you mean `strain`?"]),
    ("{pressure: [250]}}", "{pressure: [250]}, ▸leave_one_level_out: true}", ["both", "choose one"]),
    ("{pressure: [250]}", "{pressure: {▸between: [[3, 2]]}}", ["the interval runs from 3 to 2"]),
    ("{pressure: [250]}", "{pressure: ▸250}", ["should be a list or a mapping, but is 250", "write `[250]`"]),
    ("{pressure: [250]}", "{▸recording: [a]}", ["unknown key `recording` in `data.split.validate`", "did you mean `recordings`?"]),
    # units
    ("length: 88 mm", "length: ▸88 kPa", ["'kPa' (a pressure) cannot be converted to 'm' (a length)", "same dimension"]),
    ("at: [80, 150,", "at: [80, ▸150 kpa,", ["unit 'kpa' is unknown", "did you mean `kPa`?"]),
    ("unit: kPa", "unit: ▸kpa", ["unit 'kpa' is unknown", "did you mean `kPa`?"]),
    ("unit: kPa", "unit: ▸mm", ["'mm' (a length) cannot be converted to 'kPa' (a pressure)"]),
    ("unit: N}", "unit: N, offset: ▸1 bar}", ["'bar' (a pressure) cannot be converted to 'N' (a force)"]),
    ("target: static", "units: {pressure: ▸mm}\ntarget: static", ["'mm' (a length) cannot be converted to 'kPa'"]),
    ("target: static", "units: {▸presure: bar}\ntarget: static", ["no quantity `presure`", "did you mean `pressure`?"]),
    ("force:    {", "heat: {column: T, unit: ▸degZ}\n    force:    {", ["unit 'degZ' is unknown", "did you mean `degC`?"]),
    ("require: {nrmse: 0.05}", "require: {rmse: ▸5 kPa}", ["cannot be converted to 'N' (a force)"]),
    # names
    ("over: strain", "over: ▸strian", ["no quantity `strian`", "did you mean `strain`?"]),
    ("of: pressure", "of: ▸presure", ["no quantity `presure`", "did you mean `pressure`?"]),
    ("{pressure: [250]}", "{▸presure: [250]}", ["no quantity `presure`", "did you mean `pressure`?"]),
    ("of: [strain]", "of: [strain, ▸pressur]", ["no quantity `pressur`", "did you mean `pressure`?"]),
    ("segment:\n  strain:", "segment:\n  ▸strian:", ["no quantity `strian`"]),
    ("extrapolation: continue", "extrapolation: {▸strian: zero}", ["no quantity `strian`"]),
    ("target: static", "target: {column: ▸forc}", ["no quantity `forc`", "did you mean `force`?"]),
    ("  cycles:", "  derive: {rate: {rate_of: ▸strian, window: 1}}\n  cycles:", ["no quantity `strian`"]),
    ("  cycles:", "  derive: {▸force: strain}\n  cycles:", ["`force` is a column and derived as well", "another name"]),
    ("  cycles:", "  derive: {▸a: b + 1, b: 2*a}\n  cycles:", ["in a circle", "a <- b"]),
    ("  cycles:", "  derive: {▸a: 2*a}\n  cycles:", ["in a circle: a <- a"]),
    ("of: [strain]", "of: [strain, ▸force]", ["`force` is the target", "take it out"]),
    ("against: [sarosi,", "against: [▸sarosy,", ["no literature model `sarosy`", "did you mean `sarosi`?"]),
    ("against: [sarosi,", "against: [{model: ▸sarosy},", ["no literature model `sarosy`"]),
    ("against: [sarosi,", "against: [{model: sarosi, ▸starts: published},", ["goes with a `model` and `method: levenberg_marquardt`"]),
    (
        "against: [sarosi,",
        "against: [{model: sarosi, method: levenberg_marquardt, starts: ▸mine},",
        ["no starting values called `mine`", "random, published, printed"],
    ),
    (", diameter: 20 mm}", "}\nmodel: {type: literature, name: ▸tondu_lopez_fixed_area}", ["needs the diameter of the muscle", "10 mm"]),
    ("segment:", "model: {backbone: ▸tondu_lopez_fixed_area}\nsegment:", ["is no backbone", "type: literature"]),
    ("segment:", "model: {▸starts: published}\nsegment:", ["type `mapmore` has no `starts`"]),
    ("against: [sarosi,", "against: [{model: sarosi, errors_in: ▸strian},", ["no input `strian`", "did you mean `strain`?"]),
    ("against: [sarosi,", "against: [{model: sarosi_hinged, errors_in: ▸strain},", ["a way of its own"]),
    ("against: [sarosi,", "against: [{run: other.yaml, ▸errors_in: strain},", ["goes with a formula"]),
    ("[sarosi, polynomial_2]", "[sarosi, ▸sarosi]", ["two models of the scores are named `sarosi`", "as: NAME"]),
    ("against: [sarosi,", "against: [▸{model: sarosi, as: mapmore},", ["named `mapmore`"]),
    ("{nrmse: 0.05}", "{▸nmrse: 0.05}", ["no metric `nmrse`", "did you mean `nrmse`?"]),
    ("{nrmse: 0.05}", "{▸curve: 1}", ["no metric `curve`", "`rmse`"]),
    # expressions: the place is that of the slip within the text
    ("exp(-strain/0.02)", "exp(-▸strian/0.02)", ["no quantity `strian`", "did you mean `strain`?"]),
    ("exp(-strain/0.02)", "exp(-strain/0.02▸", ["not an expression"]),
    ("exp(-strain/0.02)", "strain ▸; import os", ["not an expression"]),
    ("exp(-strain/0.02)", "strain*▸force", ["`force` is the target"]),
    ("exp(-strain/0.02)", "strain^2*▸train", ["no quantity `train`"]),
    ("  cycles:", "  derive: {a: '(1 + strain▸'}\n  cycles:", ["not an expression"]),
    # choices that do not fit each other
    ("{pressure: [250]}", "{pressure: [▸450]}", ["450 is no level of `pressure`", "levels are 80, 150, 250, 350"]),
    ("segment:\n", "segment:\n  ▸pressure: {method: even, count: 2}\n", ["constant within a curve", "`pressure: none`"]),
    ("{method: even, count: 4}", "▸levels", ["`strain` has no levels"]),
    ("strain: {method", "▸force: {method", ["`force` is the target"]),
]  # fmt: skip


OTHER_SLIPS = [
    # how files are read
    (LOGS, "header: 2", "header: ▸0", ["`data.header` should be at least 1, but is 0"]),
    (LOGS, "skip_rows: 1", "skip_rows: ▸-1", ["`data.skip_rows` should be at least 0"]),
    (LOGS, 'delimiter: ";"', "▸delimiter: semicolon", ["'semicolon' cannot separate fields", "`tab`, or `whitespace`"]),
    (LOGS, '  delimiter: ";"\n  decimal', "  ▸decimal", ["the decimal point also separates the fields", 'delimiter: ";"']),
    (LOGS, "encoding: latin-1", "▸encoding: latin-one", ["encoding 'latin-one' is unknown", "`latin-1`"]),
    (LOGS, "encoding: latin-1", "▸encoding: base64", ["encoding 'base64' is unknown"]),
    (
        LOGS,
        "  header: 2",
        "  ▸sheet: Run1\n  header: 2",
        ["reader `csv` has no use for `sheet`", "belongs to `xlsx`"],
    ),
    (LOGS, "  header: 2", "  reader: ▸excel\n  header: 2", ["`data.reader` cannot be the text 'excel'", "`xlsx`"]),
    (LOGS, "reader: mat\n      root", "reader: xlsx\n      ▸root", ["reader `xlsx` has no use for `root`", "`hdf5` and `mat`"]),
    (LOGS, "reader: xlsx, sheet: Run1, columns", "reader: tdms, ▸columns", ["finds columns by name", "Group/Channel"]),
    (FORMULA, "columns: {pressure", "every: ▸0, columns: {pressure", ["`data.every` should be at least 1"]),
    (FORMULA, "columns: {pressure: {", "▸columns: {pressure: {rest: 1 s, ", ["`rest` needs the time", "`sample_time`"]),
    (LOGS, "  resample:", "  ▸sample_time: 1 ms\n  resample:", ["`time` is a column, and `sample_time`", "keep one"]),
    (STATIC, "files: [", "files: [{path: a.csv, keep: [{quantity: ▸tim, above: 1}]}, ", ["no quantity `tim`", "did you mean `time`?"]),
    # joined logs and the clock
    (LOGS, "shift: -40.2 s", "shift: ▸-40.2 kPa", ["'s' (a time)"]),
    (LOGS, "on: row", "on: ▸rows", ["`data.join[1].on` cannot be the text 'rows'", "did you mean `row`?"]),
    (LOGS, "on: row", "on: row, ▸max_gap: 1 s", ["has no use for `shift` and `max_gap`"]),
    (LOGS, "on: row", "▸on: time", ["a join on time needs the time of the second log"]),
    (LOGS, "strain: {column: 2}", "▸force: {column: 2}, strain: {column: 3}", ["`force` is a column already", "another name"]),
    (LOGS, "strain: {column: 2}", "strain: {column: 2, unit: ▸mm}", ["'mm' (a length)"]),
    (
        FORMULA,
        "columns: {pressure",
        "join: [▸{files: [b.csv], columns: {time: {column: 0}, load: {column: 1}}}], columns: {pressure",
        ["a join on time needs the time of the first log"],
    ),
    (LOGS, "longer_than: 10 ms", "longer_than: ▸10 mm", ["'s' (a time)"]),
    (LOGS, "action: split", "action: ▸splitt", ["did you mean `split`?"]),
    (LOGS, "resample: 0.5 ms", "resample: ▸0 ms", ["`data.resample` should be greater than 0"]),
    (FORMULA, "columns: {pressure", "▸resample: 1 s, columns: {pressure", ["`resample` needs the time", "`sample_time`"]),
    (FORMULA, "columns: {pressure", "▸gaps: {longer_than: 1 s}, columns: {pressure", ["`gaps` needs the time"]),
    (FORMULA, "name: formula", "▸nam: formula", ["unknown key `nam`", "did you mean `name`?"]),
    (FORMULA, "name: formula\n", "▸units: {}\n", ["the spec lacks the key `name`", "add `name: ...`"]),
    (FORMULA, "target: static", "target: ▸hysteresis", ["`hysteresis` needs load cycles", "add `cycles"]),
    (FORMULA, "static\nmodel: {type: literature, name: sarosi}", "static\n▸dictionary: []", ["no candidate terms", "`[{polynomial: "]),
    (FORMULA, "model: {type: literature, name: sarosi}", "▸model: {backbone: sarosi}", ["no candidate terms"]),
    (FORMULA, "type: literature, name: sarosi", "type: auto, ▸backbone: sarosi", ["type `auto` has no `backbone`"]),
    (FORMULA, "type: literature, name: sarosi}", "type: auto}\n▸fit: {max_terms: 2}", ["`fit` is part of the structure"]),
    (FORMULA, "name: sarosi", "name: sarosi, ▸budget: 10 s", ["type `literature` has no `budget`"]),
    (FORMULA, "type: literature, name: sarosi", "▸type: literature", ["needs the `name` of a formula"]),
    (FORMULA, "name: sarosi", "name: sarosi, ▸backbone: sarosi", ["has no `backbone`"]),
    (FORMULA, "type: literature, name: sarosi", "▸name: sarosi", ["type `mapmore` has no `name`"]),
    (FORMULA, "name: sarosi", "name: ▸saroshi", ["no literature model `saroshi`", "did you mean `sarosi`?"]),
    (FORMULA, "{column: 3}}}", "{column: 3}}, split: {▸leave_one_level_out: true}}", ["no levels to leave out"]),
    (FORMULA, "3}}", "3}}, derive: {▸r: {rate_of: strain, window: 1 s}}", ["the rate `r` needs the time", "add `time`"]),
    (FORMULA, ", force: {column: 3}}}\ntarget: static", "}}\ntarget: ▸static", ["needs the quantity `force`", "add `force` to `columns`"]),
    (MEASURED, "set: {length: 182 mm}", "set: {length: ▸182 N}", ["'N' (a force)"]),
    (MEASURED, "abs_below: 25 kPa/s", "abs_below: ▸25 kPa", ["(a pressure) cannot be converted to 'bar/s' (a pressure rate)"]),
    (MEASURED, "window: 30 ms", "window: ▸30 mm", ["'s' (a time)"]),
    (MEASURED, "at: [100 kPa, 2]", "at: [▸100 N, 2]", ["'N' (a force)"]),
    (MEASURED, "below: 1 %", "below: ▸1 mm", ["'1' (a plain number)"]),
    (MEASURED, "[200 kPa, 2.6]", "[200 kPa, ▸2.6 m]", ["'m' (a length)"]),
    (MEASURED, "at: [0, 4 %", "at: [0, ▸4 mm", ["'mm' (a length)"]),
    (MEASURED, "rmse: 5 mN", "rmse: ▸5 mm", ["'N' (a force)"]),
    (MEASURED, "{sarosi: 2.5 %}", "{sarosi: ▸2.5 s}", ["'s' (a time)"]),
    (MEASURED, "offset: 1 bar", "offset: ▸1 m", ["cannot be converted to 'psi' (a pressure)"]),
]


@pytest.mark.parametrize(
    ("base", "old", "new", "words"), [(STATIC, *slip) for slip in SLIPS] + OTHER_SLIPS, ids=lambda value: str(value)[:40]
)
def test_one_slip_gives_one_message_with_its_place(tmp_path: Path, base: str, old: str, new: str, words: list[str]) -> None:
    refuse_slip(tmp_path, base, old, new, words)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (STATIC.replace("target: static\n", ""), ["1:1", "lacks the key `target`", "add `target: ...`"]),
        (FORMULA.replace("type: literature, name: sarosi", "type: mapmore"), ["no candidate terms", "add a `dictionary`"]),
        (FORMULA.replace("strain: {column: 2}, ", ""), ["4:33", "`sarosi` needs the quantity `strain`", "leave `sarosi` out"]),
        ("{}", ["1:1", "lacks the key `name`"]),
    ],
)
def test_what_is_missing_is_placed_at_what_needs_it(tmp_path: Path, text: str, words: list[str]) -> None:
    message = refusal(tmp_path, text)
    assert all(word in message for word in words), message


def test_all_mistakes_are_reported_at_once_in_the_order_of_the_file(tmp_path: Path) -> None:
    text = (
        STATIC.replace("muscle: {", "muscle: {nmae: x, ")
        .replace("{column: eps}", "{column: eps, unit: kpa}")
        .replace("over: strain", "over: sprain")
    )
    text = text.replace("max_terms: 1", "max_terms: none").replace("order: 4", "order: 99").replace("sarosi", "sarosy") + "name: again\n"
    message = refusal(tmp_path, text)
    starts = [line.split(": ")[0] for line in message.splitlines() if line.startswith("spec.yaml")]
    assert starts == [f"spec.yaml:{place}" for place in ("3:10", "10:35", "12:18", "19:39", "21:41", "24:13", "27:1")]


def test_a_message_shows_the_line_with_a_caret_under_the_mistake(tmp_path: Path) -> None:
    lines = refusal(tmp_path, STATIC.replace("max_terms", "max_term")).splitlines()
    assert lines[0] == "spec.yaml:21:30: unknown key `max_term` in `fit`"
    assert lines[1].split(" | ")[1] == "fit:  {scaling: unit_square, max_term: 1, tolerance: 1.0e-4}"
    assert lines[1][lines[2].index("^") :].startswith("max_term")
    assert lines[3] == "  did you mean `max_terms`?"


def test_the_caret_finds_its_place_in_a_long_line(tmp_path: Path) -> None:
    padding = ", ".join(f'"file_{i}.csv"' for i in range(60))
    lines = refusal(tmp_path, STATIC.replace("files: [", f"files: [{padding}, 5, ")).splitlines()
    assert lines[1][lines[2].index("^")] == "5"
    assert len(lines[1]) < 130


def test_a_thousand_mistakes_are_counted_rather_than_listed(tmp_path: Path) -> None:
    message = refusal(tmp_path, STATIC + "".join(f"unknown_{i}: 1\n" for i in range(1000)))
    assert message.count("unknown key") == 25
    assert message.endswith("... and at least 175 more mistakes")


def test_terms_that_are_wrong_hide_no_other_mistake(tmp_path: Path) -> None:
    text = STATIC.replace('  - terms: ["exp(-strain/0.02)"]\n', "").replace("order: 4", "order: 99").replace("sarosi", "sarosy")
    message = refusal(tmp_path, text)
    assert message.count("spec.yaml:") == 2, message
    assert "`dictionary[0].polynomial.order` should be at most 20" in message
    assert "no literature model `sarosy`" in message


def test_what_follows_from_a_broken_section_is_not_reported(tmp_path: Path) -> None:
    message = refusal(tmp_path, STATIC.replace("columns:", "colums:"))
    assert message.count("spec.yaml:") == 1, message


def test_an_unknown_key_hides_no_other_mistake(tmp_path: Path) -> None:
    message = refusal(tmp_path, STATIC.replace("sarosi", "sarosy") + "taget: 3\n")
    assert message.count("spec.yaml:") == 2, message
    assert "no literature model `sarosy`" in message
    assert "did you mean `target`?" in message


def test_what_follows_from_a_misspelt_key_is_not_reported(tmp_path: Path) -> None:
    message = refusal(tmp_path, STATIC.replace("levels: {", "levls: {"))
    assert message.count("spec.yaml:") == 1, message
