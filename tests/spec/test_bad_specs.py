"""Documents that must be refused: each with its place, what is wrong, and what would be right."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from spec_examples import DAMPING, FORCE, FORMULA, LOGS, MEASURED, MOTION, RECORD, STATIC, refusal

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.spec.loader import load
from mapmore_cli.spec.units import is_quantity, split_quantity

POLYNOMIAL, LAGS = (
    "polynomial: {of: [strain], order: 4}",
    "lags: {of: [displacement, pressure], steps: [1, 2], order: 2}",
)
# What the static study says, what it says instead with ▸ before the place of the mistake, words of
# message and remedy.
STATIC_SLIPS = [
    # keys
    ("max_terms: 1", "▸max_term: 1", ["unknown key `max_term` in `fit`",
        "did you mean `max_terms`?"]),
    ("muscle:", "▸muskle:", ["unknown key `muskle`", "did you mean `muscle`?"]),
    ("reader: csv", "▸xyz: 1", ["unknown key `xyz` in `data`", "known are `files`, `reader`"]),
    ("strain:   {column: eps}", "▸strain:   {unit: '1'}",
        ["`data.columns.strain` lacks the key `column`"]),
    ("{column: eps}", "{▸colum: eps}", ["unknown key `colum` in `data.columns.strain`",
        "did you mean `column`?"]),
    ("strain:   {column", "▸my strain: {column", ["'my strain' cannot be the name of a quantity",
        "letters, digits"]),
    # values of the wrong kind
    ("max_terms: 1", "max_terms: ▸one",
        ["`fit.max_terms` should be a whole number, but is the text 'one'"]),
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
    ("reader: csv", "header: ▸no",
        ["`data.header` should be true or false or a number, but is the text 'no'"]),
    ("[strain], order", "▸strain, order", ["should be a list, but is the text 'strain'",
        "write `[strain]`"]),
    ("fit:  {", "fit: ▸3 #{", ["`fit` should be a mapping, but is 3"]),
    ("fit:  {", "fit:▸ #{", ["`fit` should be a mapping, but is empty"]),
    ("name: dmsp-20-88-static", "name: ▸../up", ["`name` cannot be the text '../up'",
        "letter or digit"]),
    ("name: dmsp-20-88-static", "name: ▸12", ["`name` should be text, but is 12",
        "put it in quotes"]),
    ("schema_version: 1", "schema_version: ▸2", ["`schema_version` cannot be 2", "1"]),
    ("files: [", "files: ▸[] #", ["`data.files` is empty", "at least 1"]),
    ("files: [", "files: [▸7, ", ["`data.files[0]` should be text or a mapping, but is 7"]),
    # words
    ("target: static", "target: ▸statics", ["no quantity `statics`", "no kind of target",
        "did you mean `static`?"]),
    ("target: static", "target: ▸forc", ["no quantity `forc`", "did you mean `force`?"]),
    ("target: static", "target: ▸xyz", ["`strain`, `force`, `static`, `hysteresis`"]),
    ("target: static", "target: {column: ▸static}", ["no quantity `static`"]),
    ("target: static", "target: ▸[static]",
        ["`target` should be text or a mapping, but is a list"]),
    ("unit_square", "▸unitsquare", ["did you mean `unit_square`?"]),
    ("extrapolation: continue", "extrapolation: ▸hold",
        ["possible are `continue`, `continue_linear`, `saturate`, `zero`"]),
    ("extrapolation: continue", "extrapolation: {strain: {above: ▸zerro}}",
        ["did you mean `zero`?"]),
    ("[data, fit, error, nrmse]", "[data, ▸fits]", ["did you mean `fit`?"]),
    ("method: even, count: 4", "method: ▸evn, count: 4", ["did you mean `even`?"]),
    ("at: [80, 150, 250, 350]", "at: ▸autos", ["did you mean `auto`?"]),
    # keys of one section that do not fit each other
    ("method: even, count: 4", "▸method: even", ["method `even` needs `count`", "count: 4"]),
    ("method: even, count: 4", "▸method: breakpoints", ["method `breakpoints` needs `at`"]),
    ("method: even, count: 4", "method: breakpoints, ▸count: 4, at: [1]", ["has no use for `count`",
        "remove `count`"]),
    ("method: even, count: 4", "method: breakpoints, ▸at: [0.2, 0.1, 20 %]", ["do not increase",
        "[0.1, 0.2]"]),
    ("  cycles:", "  keep: [{▸quantity: strain}]\n  cycles:", ["`keep` has no condition",
        "give one of `abs_below`"]),
    ("  cycles:", "  keep: [{quantity: strain, below: 1, ▸above: 0}]\n  cycles:", ["two conditions",
        "`below`, `above`"]),
    ("  cycles:", "  keep: [{quantity: strain, ▸between: [1, 0]}]\n  cycles:", ["from 1 to 0",
        "lower end first"]),
    ("  cycles:", "  keep: [{quantity: strain, ▸outside: [1, 1]}]\n  cycles:",
        ["`outside` runs from 1 to 1", "lower end first"]),
    ("  cycles:", "  keep: [{quantity: strain, between: ▸[1]}]\n  cycles:", ["too few values",
        "[low, high]"]),
    ("  cycles:", "  keep: [{quantity: strain, between: ▸[1, 2, 3]}]\n  cycles:",
        ["too many values"]),
    ("350]}", "350], ▸within: 50}", ["levels overlap: they lie 70 apart", "35 or less"]),
    ("at: [80, 150, 250, 350]", "▸at: [80, 150, 250, 350, 1.5 bar]", ["level 150 is given twice",
        "give each level once"]),
    ("- polynomial: {of: [strain], order: 4}", "- ▸{}", ["no family of terms"]),
    ("- polynomial: {of: [strain], order: 4}",
        "- ▸{polynomial: {of: [strain], order: 4}, terms: [strain]}", ["two families"]),
    ("validate: {pressure: [250]}", "▸validate: {}", ["does not say what is held out"]),
    ("{pressure: [250]}", "{pressure: [250], ▸seed: 1}", ["`seed` draws nothing here",
        "`fraction`"]),
    ("{pressure: [250]}", "{▸last_cycles: 0.5}", ["`last_cycles` and `of` go together",
        "of: pressure"]),
    ("{pressure: [250]}", "{pressure: [250], ▸of: strain}", ["`last_cycles` and `of` go together"]),
    ("{pressure: [250]}", "{last_cycles: ▸2, of: strain}", ["should be less than 1"]),
    ("{pressure: [250]}", "{last_cycles: 0.5, of: ▸strian}", ["no quantity `strian`",
        "did you mean `strain`?"]),
    ("{pressure: [250]}}", "{pressure: [250]}, ▸leave_one_level_out: true}", ["both",
        "choose one"]),
    ("{pressure: [250]}", "{pressure: {▸between: [[3, 2]]}}", ["the interval runs from 3 to 2"]),
    ("{pressure: [250]}", "{pressure: ▸250}", ["should be a list or a mapping, but is 250",
        "write `[250]`"]),
    ("{pressure: [250]}", "{▸recording: [a]}", ["unknown key `recording` in `data.split.validate`",
        "did you mean `recordings`?"]),
    # units
    ("length: 88 mm", "length: ▸88 kPa",
        ["'kPa' (a pressure) cannot be converted to 'm' (a length)", "same dimension"]),
    ("at: [80, 150,", "at: [80, ▸150 kpa,", ["unit 'kpa' is unknown", "did you mean `kPa`?"]),
    ("unit: kPa", "unit: ▸kpa", ["unit 'kpa' is unknown", "did you mean `kPa`?"]),
    ("unit: kPa", "unit: ▸mm", ["'mm' (a length) cannot be converted to 'kPa' (a pressure)"]),
    ("unit: N}", "unit: N, offset: ▸1 bar}",
        ["'bar' (a pressure) cannot be converted to 'N' (a force)"]),
    ("target: static", "units: {pressure: ▸mm}\ntarget: static",
        ["'mm' (a length) cannot be converted to 'kPa'"]),
    ("target: static", "units: {▸presure: bar}\ntarget: static", ["no quantity `presure`",
        "did you mean `pressure`?"]),
    ("force:    {", "heat: {column: T, unit: ▸degZ}\n    force:    {", ["unit 'degZ' is unknown",
        "did you mean `degC`?"]),
    ("require: {nrmse: 0.05}", "require: {rmse: ▸5 kPa}", ["cannot be converted to 'N' (a force)"]),
    # names
    ("over: strain", "over: ▸strian", ["no quantity `strian`", "did you mean `strain`?"]),
    ("of: pressure", "of: ▸presure", ["no quantity `presure`", "did you mean `pressure`?"]),
    ("{pressure: [250]}", "{▸presure: [250]}", ["no quantity `presure`",
        "did you mean `pressure`?"]),
    ("of: [strain]", "of: [strain, ▸pressur]", ["no quantity `pressur`",
        "did you mean `pressure`?"]),
    ("segment:\n  strain:", "segment:\n  ▸strian:", ["no quantity `strian`"]),
    ("extrapolation: continue", "extrapolation: {▸strian: zero}", ["no quantity `strian`"]),
    ("target: static", "target: {column: ▸forc}", ["no quantity `forc`", "did you mean `force`?"]),
    ("  cycles:", "  derive: {rate: {rate_of: ▸strian, window: 1}}\n  cycles:",
        ["no quantity `strian`"]),
    ("  cycles:", "  derive: {▸force: strain}\n  cycles:",
        ["`force` is a column and derived as well", "another name"]),
    ("  cycles:", "  derive: {▸a: b + 1, b: 2*a}\n  cycles:", ["in a circle", "a <- b"]),
    ("  cycles:", "  derive: {▸a: 2*a}\n  cycles:", ["in a circle: a <- a"]),
    ("of: [strain]", "of: [strain, ▸force]", ["`force` is the target", "take it out"]),
    ("against: [sarosi,", "against: [▸sarosy,", ["no literature model `sarosy`",
        "did you mean `sarosi`?"]),
    ("against: [sarosi,", "against: [{model: ▸sarosy},", ["no literature model `sarosy`"]),
    ("against: [sarosi,", "against: [▸old.h5,", ["no literature model `old.h5`"]),
    ("against: [sarosi,", "against: [{model: sarosi, ▸starts: published},",
        ["goes with a `model` and `method: levenberg_marquardt`"]),
    ("against: [sarosi,", "against: [{model: sarosi, method: levenberg_marquardt, starts: ▸mine},",
        ["called `mine`"]),
    (", diameter: 20 mm}", "}\nmodel: {type: literature, name: ▸tondu_lopez_fixed_area}",
        ["needs the diameter of the muscle", "10 mm"]),
    ("segment:", "model: {backbone: ▸tondu_lopez_fixed_area}\nsegment:", ["needs the diameter",
        "type: literature"]),
    ("segment:", "model: {▸starts: published}\nsegment:", ["unknown key `starts`",
        "`validate.against`"]),
    ("[sarosi, polynomial_2]", "[sarosi, ▸sarosi]", ["two models of the scores are named `sarosi`",
        "as: NAME"]),
    ("against: [sarosi,", "against: [▸{model: sarosi, as: mapmore},", ["named `mapmore`"]),
    ("{nrmse: 0.05}", "{▸nmrse: 0.05}", ["no metric `nmrse`", "did you mean `nrmse`?"]),
    # expressions: the place is that of the slip within the text
    ("exp(-strain/0.02)", "exp(-▸strian/0.02)", ["no quantity `strian`", "did you mean `strain`?"]),
    ("exp(-strain/0.02)", "exp(-strain/0.02▸", ["not an expression"]),
    ("exp(-strain/0.02)", "strain ▸; import os", ["not an expression"]),
    ("exp(-strain/0.02)", "strain*▸force", ["`force` is the target"]),
    ("exp(-strain/0.02)", "strain^2*▸train", ["no quantity `train`"]),
    ("  cycles:", "  derive: {a: '(1 + strain▸'}\n  cycles:", ["not an expression"]),
    # choices that do not fit each other
    ("{pressure: [250]}", "{pressure: [▸450]}", ["450 is no level of `pressure`",
        "levels are 80, 150, 250, 350"]),
    ("segment:\n", "segment:\n  ▸pressure: {method: even, count: 2}\n", ["constant within a curve",
        "`pressure: none`"]),
    ("{method: even, count: 4}", "▸levels", ["`strain` has no levels"]),
    ("strain: {method", "▸force: {method", ["`force` is the target"]),
]  # fmt: skip

EVEN = "{method: even, count: 4}"
FUSE = "fuse: {transition: linear, z_s: 0.25,"
OPTIMAL = STATIC.replace(EVEN, "{method: optimal, count: 4}")
JOIN = "{files: [b.csv], columns: {time: {column: 0}, load: {column: 1}}}"
POOLED = STATIC.replace(EVEN, f"{EVEN}\n  pressure: none")
DERIVED = FORCE.replace("target: static", "target: damping\nneeds: {static: s.yaml}").replace(
    "3}}", "3}}, plateau: auto"
)
NO_DELAYS = RECORD.replace("max_terms: 12, stop: bic", "max_terms: 4")

OTHER_SLIPS = [
    # how files are read
    (LOGS, "header: 2", "header: ▸0", ["`data.header` should be at least 1, but is 0"]),
    (LOGS, "skip_rows: 1", "skip_rows: ▸-1", ["`data.skip_rows` should be at least 0"]),
    (LOGS, 'delimiter: ";"', "▸delimiter: semicolon", ["'semicolon' cannot separate fields",
        "`tab`, or `whitespace`"]),
    (LOGS, '  delimiter: ";"\n  decimal', "  ▸decimal",
        ["the decimal point also separates the fields", 'delimiter: ";"']),
    (LOGS, "encoding: latin-1", "▸encoding: latin-one", ["encoding 'latin-one' is unknown",
        "`latin-1`"]),
    (LOGS, "encoding: latin-1", "▸encoding: base64", ["encoding 'base64' is unknown"]),
    (LOGS, "  header: 2", "  ▸sheet: Run1\n  header: 2", ["reader `csv` has no use for `sheet`",
        "belongs to `xlsx`"]),
    (LOGS, "  header: 2", "  reader: ▸excel\n  header: 2",
        ["`data.reader` cannot be the text 'excel'", "`xlsx`"]),
    (LOGS, "reader: mat\n      root", "reader: xlsx\n      ▸root",
        ["reader `xlsx` has no use for `root`", "`hdf5` and `mat`"]),
    (LOGS, "reader: xlsx, sheet: Run1, columns", "reader: tdms, ▸columns", ["finds columns by name",
        "Group/Channel"]),
    (FORMULA, "columns: {pressure", "every: ▸0, columns: {pressure",
        ["`data.every` should be at least 1"]),
    (FORMULA, "columns: {pressure: {", "▸columns: {pressure: {rest: 1 s, ",
        ["`rest` needs the time", "`sample_time`"]),
    (LOGS, "  resample:", "  ▸sample_time: 1 ms\n  resample:",
        ["`time` is a column, and `sample_time`", "keep one"]),
    (STATIC, "files: [", "files: [{path: a.csv, keep: [{quantity: ▸tim, above: 1}]}, ",
        ["no quantity `tim`", "did you mean `time`?"]),
    # joined logs and the clock
    (LOGS, "shift: -40.2 s", "shift: ▸-40.2 kPa", ["'s' (a time)"]),
    (LOGS, "on: row", "on: ▸rows", ["`data.join[1].on` cannot be the text 'rows'",
        "did you mean `row`?"]),
    (LOGS, "on: row", "on: row, ▸max_gap: 1 s", ["has no use for `shift` and `max_gap`"]),
    (LOGS, "on: row", "▸on: time", ["a join on time needs the time of the second log"]),
    (LOGS, "strain: {column: 2}", "▸force: {column: 2}, strain: {column: 3}",
        ["`force` is a column already", "another name"]),
    (LOGS, "strain: {column: 2}", "strain: {column: 2, unit: ▸mm}", ["'mm' (a length)"]),
    (FORMULA, "columns: {pressure", f"join: [▸{JOIN}], columns: {{pressure",
        ["a join on time needs the time of the first log"]),
    (LOGS, "longer_than: 10 ms", "longer_than: ▸10 mm", ["'s' (a time)"]),
    (LOGS, "action: split", "action: ▸splitt", ["did you mean `split`?"]),
    (LOGS, "resample: 0.5 ms", "resample: ▸0 ms", ["`data.resample` should be greater than 0"]),
    (FORMULA, "columns: {pressure", "▸resample: 1 s, columns: {pressure",
        ["`resample` needs the time", "`sample_time`"]),
    (FORMULA, "columns: {pressure", "▸gaps: {longer_than: 1 s}, columns: {pressure",
        ["`gaps` needs the time"]),
    (FORMULA, "name: formula", "▸nam: formula", ["unknown key `nam`", "did you mean `name`?"]),
    (FORMULA, "name: formula\n", "▸units: {}\n", ["the spec lacks the key `name`",
        "add `name: ...`"]),
    (FORMULA, "target: static", "target: ▸hysteresis", ["`hysteresis` needs load cycles",
        "add `cycles"]),
    (FORMULA, "static\nmodel: {type: literature, name: sarosi}", "static\n▸dictionary: []",
        ["no candidate terms", "`[{polynomial: "]),
    (FORMULA, "model: {type: literature, name: sarosi}", "▸model: {backbone: sarosi}",
        ["no candidate terms"]),
    (FORMULA, "type: literature, name: sarosi", "type: auto, ▸backbone: sarosi",
        ["type `auto` has no `backbone`"]),
    (FORMULA, "type: literature, name: sarosi}", "type: auto}\n▸fit: {max_terms: 2}",
        ["`fit` is part of the structure"]),
    (FORMULA, "name: sarosi", "name: sarosi, ▸budget: 10 s", ["type `literature` has no `budget`"]),
    (FORMULA, "type: literature, name: sarosi", "▸type: literature",
        ["needs the `name` of a formula"]),
    (FORMULA, "name: sarosi", "name: sarosi, ▸backbone: sarosi", ["has no `backbone`"]),
    (FORMULA, "type: literature, name: sarosi", "▸name: sarosi", ["type `mapmore` has no `name`"]),
    (FORMULA, "name: sarosi", "name: ▸saroshi", ["no literature model `saroshi`",
        "did you mean `sarosi`?"]),
    (FORMULA, "{column: 3}}}", "{column: 3}}, split: {▸leave_one_level_out: true}}",
        ["no levels to leave out"]),
    (FORMULA, "3}}", "3}}, derive: {▸r: {rate_of: strain, window: 1 s}}",
        ["the rate `r` needs the time", "add `time`"]),
    (FORMULA, ", force: {column: 3}}}\ntarget: static", "}}\ntarget: ▸static",
        ["needs the quantity `force`", "add `force` to `columns`"]),
    (MEASURED, "set: {length: 182 mm}", "set: {length: ▸182 N}", ["'N' (a force)"]),
    (MEASURED, "abs_below: 25 kPa/s", "abs_below: ▸25 kPa",
        ["(a pressure) cannot be converted to 'bar/s' (a pressure rate)"]),
    (MEASURED, "window: 30 ms", "window: ▸30 mm", ["'s' (a time)"]),
    (MEASURED, "at: [100 kPa, 2]", "at: [▸100 N, 2]", ["'N' (a force)"]),
    (MEASURED, "below: 1 %", "below: ▸1 mm", ["'1' (a plain number)"]),
    (MEASURED, "[200 kPa, 2.6]", "[200 kPa, ▸2.6 m]", ["'m' (a length)"]),
    (MEASURED, "at: [0, 4 %", "at: [0, ▸4 mm", ["'mm' (a length)"]),
    (MEASURED, "rmse: 5 mN", "rmse: ▸5 mm", ["'N' (a force)"]),
    (MEASURED, "{sarosi: 2.5 %}", "{sarosi: ▸2.5 s}", ["'s' (a time)"]),
    (MEASURED, "offset: 1 bar", "offset: ▸1 m", ["cannot be converted to 'psi' (a pressure)"]),
    # segments and how they are joined
    (STATIC, EVEN, "{▸method: gradient}", ["method `gradient` needs `count`"]),
    (STATIC, EVEN, "{method: even, count: 4, ▸at: [0.1]}",
        ["method `even` has no use for `at`", "remove `at`"]),
    (OPTIMAL, "report:", "model: {type: literature, name: sarosi}\nreport:",
        ["`optimal` places boundaries by fits of terms"]),
    # keys that there were, with what to do instead
    (STATIC, FUSE, "fuse: {levels: ▸phcip,", ["did you mean `pchip`?"]),
    (STATIC, FUSE, "fuse: {▸align: threshold,", ["unknown key `align` in `fuse`", "backbone"]),
    (STATIC, EVEN, "{method: optimal, count: 2, ▸grid: 8}", ["grid of 20 cells"]),
    (MOTION, "terms: [", "▸delays: {of: [pressure], times: [1 s]}\n  - terms: [",
        ["unknown key `delays`", "count samples"]),
    # what is missing is placed at what needs it
    (STATIC, "target: static\n", "", ["spec.yaml:1:1", "lacks the key `target`",
        "add `target: ...`"]),
    (FORMULA, "type: literature, name: sarosi", "type: mapmore", ["no candidate terms",
        "add a `dictionary`"]),
    (FORMULA, "strain: {column: 2}, ", "", ["spec.yaml:4:33",
        "`sarosi` needs the quantity `strain`", "leave `sarosi` out"]),
    ("name: a\n", "name: a", "{}", ["spec.yaml:1:1", "lacks the key `name`"]),
    (FORCE.replace("[{", "[▸{play: {of: [pressure]}}, {"), "time: {column: 0}, ", "",
        ["memory needs the time", "`sample_time`"]),
    # families along a training range
    (STATIC, POLYNOMIAL, "spline: {of: ▸strane, knots: 9}", ["no quantity `strane`",
        "did you mean `strain`?"]),
    (STATIC, POLYNOMIAL, "spline: {of: strain, knots: 9, with: [▸presure]}",
        ["no quantity `presure`", "`pressure`?"]),
    (STATIC, POLYNOMIAL, "spline: {of: strain, knots: ▸1}", ["should be at least 2, but is 1"]),
    (STATIC, POLYNOMIAL, "▸spline: {of: strain}", ["lacks the key `knots`"]),
    (STATIC, POLYNOMIAL, "ends: {of: strain, widths: [▸-0.03]}",
        ["should be greater than 0, but is -0.03"]),
    (STATIC, POLYNOMIAL, "ends: {of: strain, widths: ▸[]}", ["is empty", "at least 1"]),
    (STATIC, POLYNOMIAL, "ends: {of: ▸[strain], widths: [0.1]}", ["should be text, but is a list"]),
    (STATIC, POLYNOMIAL, "ends: {of: strain, widths: [0.1], with: [pressure, ▸change]}",
        ["no quantity `change`"]),
    (STATIC, POLYNOMIAL, "ends: {of: strain, widths: [0.1], with: [pressure^▸strain]}",
        ["exponent must be a constant"]),
    (STATIC, POLYNOMIAL, "steps: {of: strain, count: ▸1, widths: [0.1]}",
        ["should be at least 2, but is 1"]),
    (MOTION, LAGS, "steps: {of: pressure, count: 5, widths: [0.1], ▸with: [change]}",
        ["`change` need each other", "window: 16"]),
    (MOTION, LAGS, "steps: {of: pressure, count: 5, widths: [0.1], ▸window: 4}", ["need each other",
        "with: [change]"]),
    (MOTION, LAGS, "steps: {of: ▸displacement, count: 5, widths: [0.1]}",
        ["a model cannot explain its target by itself"]),
    # names of terms with memory
    (MOTION, "lags: {of: [displacement, pressure]", "lags: {of: [displacement, ▸presure]",
        ["no quantity `presure`", "`pressure`?"]),
    (MOTION, '"play(pressure, 0.16)"', '"play(▸presure, 0.16)"', ["no quantity `presure`",
        "did you mean `pressure`?"]),
    (MOTION, "slow: {of: [pressure]", 'slow: {of: ["stop(▸lod, 0.1)"]', ["no quantity `lod`",
        "did you mean `load`?"]),
    (MOTION, "with: [pressure]", "with: [▸pressur]", ["no quantity `pressur`",
        "did you mean `pressure`?"]),
    (MOTION, '"pressure*displacement[k-1]"', '"load*▸presure[k-1]"', ["no quantity `presure`",
        "did you mean `pressure`?"]),
    (MOTION, "exp(-play(pressure, 0.2)", "exp(-play(slow(▸presure, 1), 0.2)",
        ["no quantity `presure`"]),
    (MOTION, '"play(pressure, 0.16)"', '▸"plai(pressure, 0.16)"',
        ["not the name of a quantity or a state", "no operator"]),
    (MOTION, '"play(pressure, 0.16)"', '"play(pressure, 0.1, 0.2▸)"',
        ["`play` takes 0 or 1 number(s)"]),
    (MOTION, '"play(pressure, 0.16)"', '"pressure▸[k+1]"', ["a delay is written [k-1]"]),
    (MOTION, "exp(-play(pressure, 0.2)/300)", "exp(-play(pressure, 0.1, 0.2▸)/300)",
        ["not an expression", "takes 0 or 1 number(s)"]),
    (FORCE, "of: [pressure, strain]", 'of: [pressure, "strain▸^2"]',
        ["not the name of a quantity or a state"]),
    (FORCE, "{polynomial: {of: [pressure, strain]",
        "{products: {with: [▸time], of: [pressure, strain]", ["`time` is none of the terms"]),
    # the target, by its past alone
    (MOTION, "steps: [1, 2]", "steps: [1, ▸0]", ["step 0 of the target `displacement`",
        "begin at 1"]),
    (MOTION, "of: [pressure, ", "of: [▸displacement, ", ["`displacement` is the target",
        "`displacement[k-1]`"]),
    (MOTION, "slow: {of: [pressure]", "slow: {of: [▸displacement]",
        ["`slow` works on `displacement` as it is now", "`displacement[k-1]`"]),
    (MOTION, '"play(pressure, 0.16)"', '"play(▸displacement, 0.16)"',
        ["`play` works on `displacement`"]),
    (MOTION, '"play(pressure, 0.16)"', '"play(▸displacement, 0.16)[k-1]"',
        ["`play` works on `displacement` as it is now"]),
    (MOTION, "lags: {of: [displacement,", 'lags: {of: ["stop(▸displacement, 0.1)",',
        ["`stop` works on `displacement` as it is now"]),
    (MOTION, '"pressure*displacement[k-1]"', "pressure*▸displacement",
        ["`displacement` is the target", "take it out"]),
    (MOTION, '"pressure*displacement[k-1]"', '▸"exp(pressure*displacement[k-1])"', ["in one factor",
        "as a product"]),
    (MOTION, "of: [displacement], steps: [5]", 'of: [▸"displacement[k-1]"], steps: [5]',
        ["no quantity", "name `displacement` itself"]),
    # what memory needs
    (MOTION, "name: motion", "name: motion\nunits: {▸time: ms}", ["goes by the time in s",
        "remove it"]),
    (MOTION, "last: 0.5", "▸fraction: 0.5", ["drawn at random", "`last: 0.25`"]),
    (MOTION, "  resample", "  ▸cycles: {over: pressure, samples: 100}\n  resample",
        ["`cycles` takes samples out of the order of time"]),
    (MOTION, "fit:", "segment: {▸pressure: {method: even, count: 2}}\nfit:",
        ["`pressure` cannot be cut", "`pressure: none`"]),
    (MOTION, "  resample", "  ▸levels: {of: load, at: [1, 2]}\n  resample",
        ["not interpolated between levels", "segment: {load: none}"]),
    (MOTION, "fit:", "fuse: {▸z_s: 0.1}\nfit:", ["there is nothing to join", "remove `z_s`"]),
    (MOTION, "ridge: auto", "ridge: auto, scaling: ▸max_abs", ["`max_abs` scales segments",
        "`none`, or `range`"]),
    (MOTION, "ridge: auto", "ridge: auto, ▸margin: 0.2", ["`margin` clips",
        "add `scaling: range`"]),
    (MOTION, "ridge: auto, ", "▸", ["pruned only where there is a ridge", "add `ridge: auto`"]),
    (MOTION, "forward: 12", "forward: ▸3", ["3 terms cannot be pruned to `max_terms: 4`",
        "4 or more"]),
    # free run
    (NO_DELAYS, "max_terms: 4", "max_terms: 4, ▸criterion: free_run",
        ["nothing of the output displacement is fed back", "add delays"]),
    # what is of memory alone
    (FORCE, "order: 2}}]", "order: 2}}]\nfit: {▸ridge: 0.1}",
        ["`ridge` belongs to terms with memory", "remove it"]),
    (FORCE, "order: 2}}]", "order: 2}}]\nfit: {▸forward: 9}",
        ["`forward` belongs to terms with memory"]),
    (FORCE, "order: 2}}]", "order: 2}}]\nfit: {stop: ▸free_run}",
        ["`stop: free_run` belongs to terms with memory"]),
    (FORCE, "order: 2}}]", "order: 2}}]\nfit: {scaling: ▸range}",
        ["`scaling: range` belongs to terms with memory"]),
    (FORCE, "column: 3}}", 'column: 3}}, derive: {a: "1 + play(▸pressure, 0.1)"}',
        ["has memory, which derived quantities have not"]),
    # damping
    (DERIVED, "{poly", "{lags: {of: [force], steps: [1]}}, {poly", ["`force` is the target",
        "take it out"]),
    (DERIVED, "{poly", '{terms: ["force[k-1]"]}, {poly', ["take it out"]),
    (DERIVED, "{poly", "{slow: {of: [force], tau: [1 s]}}, {poly", ["take it out"]),
    (DAMPING, "target: damping", "target: static",
        ["target `static` has no static and damping parts"]),
    (DAMPING, "target: damping",
        "target: damping\nmodel: {type: literature, name: sarosi_hysteresis_loss}",
            ["is fitted to load cycles"]),
    (DAMPING, "target: damping", "target: damping\nmodel: {type: literature, name: none}",
        ["`none` is no function of anything"]),
    (DAMPING, "needs: {static: dmsp-20-88-static.yaml}\n", "",
        ["target `damping` needs a static model"]),
    (DAMPING, "  plateau: auto\n", "",
        ["target `damping` needs the plateau of each step response"]),
    (DAMPING, "plateau: auto", "plateau: [3 s, 2 s]", ["the plateau runs from 3 s to 2 s"]),
    (DAMPING, "plateau: auto", "plateau: automatic", ["did you mean `auto`"]),
    (DAMPING, "dead_band: 5 kPa/s", "dead_band: 5 kPa", ["cannot be converted to 'kPa/s'"]),
    (DAMPING, "dead_band: 5 kPa/s", "dead_band: 0", ["greater than 0"]),
    (DAMPING, "direction: {of", "way: {of", ["call it `direction`"]),
    (DAMPING, "pressure_rate, dead_band: 5 kPa/s", "pressure_rat, dead_band: 5",
        ["did you mean `pressure_rate`"]),
    (DAMPING, "train_level: highest", "train_level: 300", ["300 is no level of `step_pressure`"]),
    (DAMPING, "train_level: highest", "train_level: lowest",
        ["`fit.train_level` cannot be the text 'lowest'"]),
    (DAMPING, "{static: sarosi, damping: reynolds}", "{static: sarosi}",
        ["a composite needs `static` and `damping`"]),
    (DAMPING, "{static: sarosi, damping: reynolds}", "{static: sarosy, damping: reynolds}",
        ["did you mean `sarosi`"]),
    (DAMPING, "{static: sarosi, damping: reynolds}",
        "{static: sarosi, damping: reynolds, model: sarosi}", ["a competitor is a `model`"]),
    (DAMPING, "peternel,", "sarosi_hysteresis_loss,", ["needs the length of the muscle",
        "needs the quantity `load`"]),
    (DAMPING, "peternel,", "cao, peternels,", ["did you mean `peternel`"]),
    (DAMPING, "time: {column: t, unit: s}, ", "", ["`plateau` needs the quantity `time`"]),
    (DAMPING, "target: damping", "target: damping\nmodel: {type: sum}",
        ["the sum of two models needs `needs.damping`"]),
    (DAMPING, "of: [strain, ", "of: [force, ", ["`force` is the target"]),
    # harm: refused before anything is allocated
    (STATIC, "samples: 200", "samples: 1000000000",
        ["`data.cycles.samples` should be at most 100000"]),
    (STATIC, "count: 4", "count: 1000000000", ["`segment.strain.count` should be at most 1000"]),
    (STATIC, "method: even, count: 4", "method: optimal, count: 21",
        ["21 segments do not fit on a grid of 20 cells"]),
    (STATIC, "  reader: csv", "  skip_rows: 100000000000000000000000",
        ["`data.skip_rows` should be at most"]),
    (STATIC, "  reader: csv", "  header: 100000000000000000000000",
        ["`data.header` should be at most"]),
    (STATIC, "  reader: csv", "  every: 100000000000000000000000",
        ["`data.every` should be at most"]),
    (STATIC, "{pressure: [250]}", "{fraction: 0.5, seed: -1}",
        ["`data.split.validate.seed` should be at least 0"]),
    (STATIC, "segment:\n  strain", "segment:\n  time", ["they have no `time` any more",
        "name `strain`"]),
    (STATIC, "{pressure: [250]}", "{time: {between: [[1, 2]]}}", ["they have no `time` any more"]),
    (STATIC, "of: [strain], order: 4", "of: [time], order: 4", ["they have no `time` any more"]),
    (STATIC, "tolerance: 1.0e-4", "ridge: 1.0e-10", ["lost in rounding"]),
    (STATIC, "kind: mckibben", r'kind: "\U0011ffff"', [r"\U0011ffff is no character"]),
    (STATIC, "kind: mckibben", r'kind: "\ud800"', ["half of a character"]),
    (STATIC, "load_cycle_*.csv", "e" * 300, ["no path is as long"]),
    (STATIC, "load_cycle_*.csv", "e/" * 3000, ["no path is as long"]),
    (STATIC, "load_cycle_*.csv", r"\0.csv", ["zero byte"]),
    # a Cyrillic letter
    (STATIC, "of: [strain], order: 4", "of: [str\u0430in], order: 4",
        ["not the name of a quantity"]),
    (STATIC, "  - polynomial", "  - terms: [exp(-str\u0430in)]\n  - polynomial",
        ["unexpected character '\u0430'"]),
    (STATIC, "    strain:   {", "    str\u0430in: {", ["cannot be the name of a quantity"]),
    (STATIC, "name: dmsp", "name: dm\u0455p", ["`name` cannot be the text"]),
]  # fmt: skip


@pytest.mark.parametrize(
    ("base", "old", "new", "words"),
    [(STATIC, *slip) for slip in STATIC_SLIPS] + OTHER_SLIPS,
    ids=lambda value: str(value)[:40],
)
def test_one_slip_gives_one_message_with_its_place(tmp_path, base, old, new, words):
    """The mistake is where `new` has a mark, a triangle, which is left out; there is no other
    message then.
    """
    assert old in base
    before, mark, after = base.replace(old, new, 1).partition("▸")
    message = refusal(tmp_path, before + after)
    assert all(word in message for word in words), message
    if mark:
        place = f"{before.count(chr(10)) + 1}:{len(before) - before.rfind(chr(10))}"
        assert message.startswith(f"spec.yaml:{place}: "), message
        assert message.count("spec.yaml:") == 1, message


def test_all_mistakes_are_reported_at_once_in_the_order_of_the_file(tmp_path):
    text = (
        STATIC.replace("muscle: {", "muscle: {nmae: x, ")
        .replace("{column: eps}", "{column: eps, unit: kpa}")
        .replace("over: strain", "over: sprain")
    )
    text = (
        text.replace("max_terms: 1", "max_terms: none")
        .replace("order: 4", "order: 99")
        .replace("sarosi", "sarosy")
        + "name: again\n"
    )
    message = refusal(tmp_path, text)
    starts = [line.split(": ")[0] for line in message.splitlines() if line.startswith("spec.yaml")]
    assert starts == [
        f"spec.yaml:{place}"
        for place in ("3:10", "10:35", "12:18", "19:39", "21:41", "24:13", "27:1")
    ]


def test_a_message_shows_the_line_with_a_caret_under_the_mistake(tmp_path):
    lines = refusal(tmp_path, STATIC.replace("max_terms", "max_term")).splitlines()
    assert lines[0] == "spec.yaml:21:30: unknown key `max_term` in `fit`"
    assert (
        lines[1].split(" | ")[1] == "fit:  {scaling: unit_square, max_term: 1, tolerance: 1.0e-4}"
    )
    assert lines[1][lines[2].index("^") :].startswith("max_term")
    assert lines[3] == "  did you mean `max_terms`?"


def test_the_caret_finds_its_place_in_a_long_line(tmp_path):
    padding = ", ".join(f'"file_{i}.csv"' for i in range(60))
    lines = refusal(tmp_path, STATIC.replace("files: [", f"files: [{padding}, 5, ")).splitlines()
    assert lines[1][lines[2].index("^")] == "5"
    assert len(lines[1]) < 130


def test_a_thousand_mistakes_are_counted_rather_than_listed(tmp_path):
    message = refusal(tmp_path, STATIC + "".join(f"unknown_{i}: 1\n" for i in range(1000)))
    assert message.count("unknown key") == 25
    assert message.endswith("... and at least 175 more mistakes")


@pytest.mark.parametrize(
    ("base", "slips", "words"),
    [
        (STATIC, {"columns:": "colums:"}, ["did you mean `columns`?"]),
        (STATIC, {"levels: {": "levls: {"}, ["did you mean `levels`?"]),
        (
            STATIC,
            {"name: dmsp": "taget: 3\nname: dmsp", "sarosi": "sarosy"},
            ["did you mean `target`?", "model `sarosy`"],
        ),
        (
            STATIC.replace('  - terms: ["exp(-strain/0.02)"]\n', ""),
            {"r: 4": "r: 99", "sarosi": "sarosy"},
            ["at most 20", "model `sarosy`"],
        ),
        (
            FORCE.replace("[{", "[{play: {of: [pressure], widths: [0.1], count: 2}}, {")
            + "fit: {ridge: auto}",
            {"strain], order": "strian], order"},
            ["give either `widths` or `count`", "no quantity `strian`"],
        ),
    ],
)
def test_a_mistake_hides_no_other_one_and_adds_none(tmp_path, base, slips, words):
    for old, new in slips.items():
        assert old in base
        base = base.replace(old, new)
    message = refusal(tmp_path, base)
    assert all(word in message for word in words), message
    assert message.count("spec.yaml:") == len(words), message


def test_a_long_chain_of_files_is_refused(tmp_path):
    for number in range(1500):
        (tmp_path / f"{number}.yaml").write_text(f"extends: {number + 1}.yaml\n")
    (tmp_path / "1500.yaml").write_text(STATIC)
    with pytest.raises(SpecError, match="more than 20 files extend each other"):
        load(tmp_path / "0.yaml")


@pytest.mark.parametrize(
    "text",
    [
        "1" * 100_000 + "\n",
        "1" * 100_000 + "\nx",
        " " * 100_000,
        "+" + "1" * 50_000 + "." + "1" * 50_000 + "!",
    ],
)
def test_long_numbers_are_read_in_one_go(tmp_path, text):
    """One way to match each: a pattern that tries others would take hours here."""
    assert is_quantity(text) == text.endswith(("x", "!"))
    quoted = text.replace("\n", "\\n")
    assert "length" in refusal(tmp_path, STATIC.replace("length: 88 mm", f'length: "{quoted} mm"'))


@given(
    st.floats(allow_nan=False, allow_infinity=False),
    st.sampled_from(["kPa", "mm", "%", "1", "kPa/s"]),
    st.sampled_from(["", " ", "\t"]),
)
def test_quantities_are_taken_apart(number, unit, blank):
    blank = blank or (" " if unit == "1" else "")
    assert split_quantity(f" {number!r}{blank}{unit} ") == (number, unit)
