"""No text of a file can become code: the package has no means to make it so."""

import ast
from pathlib import Path

import pytest

import mapmore_cli

PACKAGE = Path(mapmore_cli.__file__).parent
ALLOWED = frozenset()
"""Places, as `study/a.py:12`; there is none."""

CALLS = {"exec", "eval", "compile", "__import__", "execfile"}
MODULES = {
    "pickle",
    "cPickle",
    "marshal",
    "shelve",
    "dill",
    "cloudpickle",
    "joblib",
    "code",
    "runpy",
    "imp",
}
ATTRIBUTES = {
    ("os", "system"),
    ("os", "popen"),
    ("pty", "spawn"),
    ("importlib", "reload"),
    ("builtins", "exec"),
    ("builtins", "eval"),
}
OWN = ("__name__", "__package__", "formulas.__name__", "modelling.__name__")
"""How the name of a module begins that is loaded by its name: with that of a package of ours."""

LIBRARIES = {
    "storage/tables/__init__.py",
    "domain/plugins.py",
}
"""Load libraries of the readers, which are named in our source, and plug-ins, which are named by
what is installed.
"""


def is_own(argument):
    """Whether the name of a module is a constant, or begins with the name of one of our packages
    and a dot.
    """
    match argument:
        case ast.Constant(str()):
            return True
        case ast.JoinedStr([ast.FormattedValue(first), ast.Constant(text), *_]):
            return ast.unparse(first) in OWN and str(text).startswith(".")
        case ast.JoinedStr([ast.Constant(text), *_]):
            return str(text).startswith("mapmore_cli.")
    return False


def faults(tree, file):
    """What may run a text, as `study/a.py:12 eval`."""
    for node in ast.walk(tree):
        found = ""
        match node:
            case ast.Call(ast.Name(name)) if name in CALLS:
                found = name
            case ast.Name(name, ast.Load()) if name in CALLS:
                found = name
            case ast.Attribute(ast.Name(module), name) if (module, name) in ATTRIBUTES:
                found = f"{module}.{name}"
            case ast.Import(names) if {one.name.split(".")[0] for one in names} & MODULES:
                found = "import"
            case ast.ImportFrom(module, names) if module is not None:
                imported = {(module, one.name) for one in names}
                found = module if module.split(".")[0] in MODULES or imported & ATTRIBUTES else ""
            case ast.keyword("shell", ast.Constant(False)):
                continue
            case ast.keyword("shell") | ast.keyword("allow_pickle", ast.Constant(True)):
                found = str(node.arg)
            case ast.Call(
                ast.Name("import_module") | ast.Attribute(_, "import_module"), [argument, *_]
            ):
                found = "" if is_own(argument) or file in LIBRARIES else "import_module"
            case ast.Attribute(ast.Name("yaml"), "load" | "unsafe_load" | "full_load" as name):
                found = f"yaml.{name}"
        if found:
            yield f"{file}:{getattr(node, 'lineno', 0)} {found}"


@pytest.mark.parametrize(
    "folder",
    sorted({path.parent for path in PACKAGE.rglob("*.py")}),
    ids=lambda path: str(path.relative_to(PACKAGE)),
)
def test_the_package_runs_no_text(folder):
    files = {str(path.relative_to(PACKAGE)): path for path in folder.glob("*.py")}
    found = [
        one for name, path in files.items() for one in faults(ast.parse(path.read_text()), name)
    ]
    assert [one for one in found if one.split()[0] not in ALLOWED] == []


@pytest.mark.parametrize(
    "text",
    [
        *(
            "exec(a)",
            "eval(a)",
            "compile(a, '', 'exec')",
            "f = eval",
            "__import__(a)",
            "import pickle",
            "from pickle import load",
        ),
        *(
            "import os; os.system(a)",
            "from os import system",
            "run(a, shell=True)",
            "run(a, shell=b)",
            "np.load(a, allow_pickle=True)",
        ),
        *(
            "importlib.import_module(a)",
            "import_module(f'{a}.b')",
            "import_module('x' + a)",
            "import marshal",
            "yaml.load(a)",
        ),
    ],
)
def test_what_would_be_found(text):
    assert [*faults(ast.parse(text), "a.py")]


@pytest.mark.parametrize(
    "text",
    [
        "re.compile(a)",
        "terms.compiled(a)",
        "import_module(f'{__name__}.{a}')",
        "run(a, shell=False)",
    ],
)
def test_what_is_harmless(text):
    assert not [*faults(ast.parse(text), "a.py")]


def test_code_is_made_by_the_printers_alone():
    """`Code` is written as it stands; `code` takes forms that stand in the source."""
    makers = {"templates.py", "dialect.py", "program_text.py", "c_source.py", "table.py"}
    printers = [*(PACKAGE / "annexes" / "exporting").glob("*.py")]
    assert printers
    for path in printers:
        for node in ast.walk(ast.parse(path.read_text())):
            match node:
                case ast.Call(ast.Name("Code")):
                    assert path.name in makers, path.name
                case ast.Call(ast.Name("code"), [form, *_]):
                    forms = [form.body, form.orelse] if isinstance(form, ast.IfExp) else [form]
                    assert all(isinstance(one, ast.Constant) for one in forms), path.name
