"""Write the pages that are made from the program, so that they can be read in the repository too:
`python docs/generated.py` (`make generated`).

Whole pages are the commands, the gallery and the notebook. Parts of pages stand between `<!-- made:
NAME -->` and `<!-- end made -->`. A test compares every text with what this program would write.
"""

from __future__ import annotations

import ast
import inspect
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from textwrap import fill, indent
from typing import Any

from notebook import markdown, write_notebook

from mapmore_cli import api
from mapmore_cli.modelling.literature import reference as formulas
from mapmore_cli.pipeline.notebooks import LoadedModel
from mapmore_cli.storage.artefacts.reference import described as files
from mapmore_cli.study.schema import reference as keys

__all__ = ["markdown", "texts"]

DOCS = Path(__file__).parent
GALLERY = DOCS / "gallery"
HELPER = "muscle"
"""The module of the gallery that the examples share; it is no example."""

MADE = re.compile(r"(<!-- made: (\w+) -->\n).*?(<!-- end made -->)", re.DOTALL)


COPY = re.compile(r"( *)<!-- copy: (\S+) -->\n.*?<!-- end copy -->", re.DOTALL)
"""A place of a page that shows a whole file."""

LANGUAGES = {".py": "python", ".sh": "sh"}
"""Language of a shown file where it is not the suffix of its name."""


def scripts() -> list[Path]:
    """Return the examples of the gallery in alphabetical order."""
    return [path for path in sorted(GALLERY.glob("*.py")) if path.stem != HELPER]


def texts() -> dict[Path, str]:
    """Return every text that is made without running an example, by its path."""
    examples = {script: example(script) for script in scripts()}
    pages = {script.with_suffix(".md"): text for script, text in examples.items()}
    return {
        **{
            page: COPY.sub(copied, MADE.sub(made, page.read_text(encoding="utf-8")))
            for page in DOCS.glob("*.md")
        },
        **pages,
        DOCS / "commands.md": commands(),  # behind the others, among which the old one is, too
        GALLERY / "index.md": gallery(),
    }


def made(part: re.Match[str]) -> str:
    """Return a part of a page that is made from the program, between its marks."""
    return f"{part[1]}\n{PARTS[part[2]]().strip()}\n\n{part[3]}"


def copied(place: re.Match[str]) -> str:
    """Return a whole file as a block of code, indented as its marks are."""
    margin, name = place.groups()
    path = DOCS / name
    language = LANGUAGES.get(path.suffix, path.suffix[1:])
    block = f"```{language}\n{path.read_text(encoding='utf-8').rstrip()}\n```"
    text = f"<!-- copy: {name} -->\n\n{block}\n\n<!-- end copy -->"
    return indent(text, margin)


def commands() -> str:
    """Return the page of all commands, each with the text of its `--help`."""
    import typer

    from mapmore_cli.cli.app import app

    group: Any = typer.main.get_command(app)
    context = group.make_context("mapmore", [], resilient_parsing=True)
    names = group.list_commands(context)
    text = (
        "# Commands\n\nThis page shows what `mapmore COMMAND --help` prints for each command. "
        "`mapmore --help` lists the commands with one line each, and the options that every "
        "command accepts, such as `--debug` and `--no-color`.\n\n"
        f"{' · '.join(f'[{name}](#{name})' for name in names)}\n"
    )
    for name in names:
        command = group.get_command(context, name)
        with command.make_context(f"mapmore {name}", [], resilient_parsing=True) as inner:
            text += f"\n## {name}\n\n```text\n{command.get_help(inner).strip()}\n```\n"
    return text


def about(script: Path) -> str:
    """Return the docstring of an example on one line."""
    return " ".join((ast.get_docstring(ast.parse(script.read_text("utf-8"))) or "").split())


def title(script: Path) -> str:
    """Return the title of an example, which is the name of its file in words."""
    return script.stem.replace("_", " ").capitalize()


def example(script: Path) -> str:
    """Return the page of an example: what it shows, its picture and its script."""
    return (
        f"# {title(script)}\n\n{about(script)}\n\n![{title(script)}]({script.stem}.svg)\n\n"
        f"The script `docs/gallery/{script.name}` imports the module `docs/gallery/muscle.py`, "
        "which simulates a muscle and saves pictures.\n\n"
        f"```python\n{script.read_text(encoding='utf-8')}```\n"
    )


def gallery() -> str:
    """Return the page that shows all examples."""
    parts = [
        f"<div markdown>\n\n## [{title(script)}]({script.stem}.md)\n\n{about(script)}\n\n"
        f"[![{title(script)}]({script.stem}.svg)]({script.stem}.md)\n\n</div>\n"
        for script in scripts()
    ]
    return (
        "# Gallery\n\nEach picture comes from a Python script of about twenty lines. Click a "
        "picture to see its script. The tests run all of these scripts. All data in the gallery "
        "are simulated.\n\n"
        f'<div class="gallery" markdown>\n\n{chr(10).join(parts)}\n</div>\n'
    )


PYTHON: dict[str, Any] = {
    "mm.fit": api.fit,
    "mm.Fitted": api.Fitted,
    "mm.Scores": api.Scores,
    "mm.run": api.run,
    "mm.Run": api.Run,
    "mm.load_model": api.load_model,
    "mm.LoadedModel": LoadedModel,
    "mm.example": api.example,
    "mm.FROLS": api.FROLS,
}
"""What the page of Python describes, by the names that a user writes."""


def python() -> str:
    """Return the reference of the Python interface, made from signatures and docstrings."""
    return "\n".join(_described(name, value) for name, value in PYTHON.items())


def _described(name: str, value: Any) -> str:
    text = f"### {name}\n\n{_signature(name, value)}\n{docstring(inspect.getdoc(value) or '')}\n"
    for key, member in vars(value).items() if inspect.isclass(value) else ():
        method = getattr(member, "func", member)  # of a cached property
        if not key.startswith("_") and (inspect.isfunction(method) or isinstance(method, property)):
            call = _signature(key, member) if inspect.isfunction(member) else ""
            text += f"\n#### {name.removeprefix('mm.')}.{key}\n\n{call}"
            text += f"\n{docstring(inspect.getdoc(method) or '')}\n"
    return text


def _signature(name: str, value: Any) -> str:
    """Return a call with the names and defaults of its parameters; empty for a class that users get
    from a function and never make themselves.
    """
    if inspect.isclass(value) and value is not api.FROLS:
        return ""
    signature = inspect.signature(value)
    parameters = [
        one.replace(annotation=inspect.Parameter.empty)
        for one in signature.parameters.values()
        if one.name != "self"
    ]
    arguments = signature.replace(parameters=parameters, return_annotation=inspect.Signature.empty)
    call = fill(f"{name}{arguments}", 90, subsequent_indent="    ", break_on_hyphens=False)
    return f"```text\n{call}\n```\n"


def docstring(text: str) -> str:
    """Return a docstring in the style of NumPy as Markdown: sections become words in bold, their
    entries lists, and sessions of Python blocks of code.
    """
    text = re.sub(r"^(\w+)\n-{3,}$", r"**\1**\n", text, flags=re.MULTILINE)
    lines, session, entry = list[str](), False, False
    for line in text.splitlines():
        if line.startswith(">>>") and not session:
            lines.append("```python")
            session = True
        elif not line and session:
            lines.append("```")
            session = False
        heading = line.startswith("**")
        indented = line.startswith("    ") and not session
        if heading:
            entry = line.strip("*") in ("Parameters", "Attributes", "Raises", "Returns")
        if entry and line and not heading and not indented:
            line = "- " + ", ".join(f"`{name}`" for name in line.split(", ")) + ":"
        lines.append(line[2:] if entry and indented else line)
    return "\n".join([*lines, "```"] if session else lines)


def names() -> str:
    """Return a table of the formulas' names, by what they predict."""
    sections = re.findall(r"^## ([^\n]+)\n(.*?)(?=^## |\Z)", formulas(), re.MULTILINE | re.DOTALL)
    rows = [
        f"| {heading} | {', '.join(f'[`{name}`](#{name})' for name in found)} |"
        for heading, text in sections
        if (found := re.findall(r"^### (\w+)", text, re.MULTILINE))
    ]
    return "\n".join(["| what is predicted | formulas |", "|---|---|", *rows])


def sourced() -> str:
    """Return the formulas with a link from the source of each formula to its reference."""

    def linked(source: re.Match[str]) -> str:
        """Return the source with whole words for equations, and links for the short names."""
        words = source[0].replace(" = ", ", and also ")
        words = re.sub(r"\beq (?=\d+( and|-\d))", "equations ", words)
        words = re.sub(r"\beq ", "equation ", words)
        return re.sub(
            r"\b(M1|M2|W|H)\b( (?=equation|section|table))?",
            lambda name: f"the paper [{name[1]}](references.md){', ' if name[2] else ''}",
            words,
        )

    return re.sub(r"(?<=^- The source of the formula is ).*$", linked, formulas(), flags=re.M)


PARTS: dict[str, Callable[[], str]] = {
    "names": names,
    "keys": keys,
    "formulas": sourced,
    "files": files,
    "python": python,
}


def main() -> None:
    """Write all texts, then the pictures of the gallery and the notebook with its outputs."""
    for path, text in texts().items():
        path.write_text(text, encoding="utf-8")
    for script in scripts():
        subprocess.run(
            [sys.executable, script.name, f"{script.stem}.svg"],
            cwd=GALLERY,
            check=True,
            env={**os.environ, "MPLBACKEND": "agg"},
        )
    write_notebook()


if __name__ == "__main__":
    main()
