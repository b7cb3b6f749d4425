"""Make the gallery, the notebook, the references and whole tables when the site is built."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parents[1]
GALLERY = DOCS / "gallery"
PICTURES = Path(__file__).resolve().parents[2] / "build" / "gallery"
HELPER = "muscle"


def scripts() -> list[Path]:
    """Return the examples in the order of the alphabet."""
    return [path for path in sorted(GALLERY.glob("*.py")) if path.stem != HELPER]


def picture(script: Path) -> Path:
    """Return the picture of an example; make it where it is older than the script."""
    place = PICTURES / f"{script.stem}.svg"
    if not place.is_file() or place.stat().st_mtime < script.stat().st_mtime:
        PICTURES.mkdir(parents=True, exist_ok=True)
        subprocess.run(
            [sys.executable, script.name, str(place)],
            cwd=GALLERY,
            check=True,
            env={**os.environ, "MPLBACKEND": "agg"},
        )
    return place


def notebook() -> str:
    """Return the executed notebook as a page; an interpreter of its own runs it, so that nothing
    here is changed by it.
    """
    code = "import sys, notebook; sys.stdout.buffer.write(notebook.markdown().encode())"
    return subprocess.run(
        [sys.executable, "-c", code], cwd=DOCS, check=True, stdout=subprocess.PIPE
    ).stdout.decode()


def commands() -> str:
    """Return the page of all commands, each with what its `--help` prints."""
    import typer

    from mapmore_cli.cli.app import app

    group: Any = typer.main.get_command(app)
    context = group.make_context("mapmore", [], resilient_parsing=True)
    text = "# Which commands are there?\n"
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        with command.make_context(f"mapmore {name}", [], resilient_parsing=True) as inner:
            text += f"\n## {name}\n\n```text\n{command.get_help(inner).strip()}\n```\n"
    return text


def on_config(config: Any) -> Any:
    """Show the version in the head of every page."""
    from mapmore_cli import __version__

    config.site_name = f"mapmore {__version__}"
    return config


def on_files(files: Any, config: Any) -> Any:
    """Add a page and a picture for every example, and the page that shows all of them."""
    from mkdocs.structure.files import File

    files.append(File.generated(config, "commands.md", content=commands()))
    files.append(File.generated(config, "notebook.md", content=notebook()))
    index = [
        "# Gallery",
        "",
        "Each example is a script of some twenty lines in docs/gallery; the tests run it.",
        "",
        '<div class="gallery" markdown>',
        "",
    ]
    for script in scripts():
        about = ast.get_docstring(ast.parse(script.read_text(encoding="utf-8"))) or script.stem
        title = script.stem.replace("_", " ").capitalize()
        text = (
            f"# {title}\n\n{about}\n\n![{about}]({script.stem}.svg)\n\n```python\n"
            f"{script.read_text(encoding='utf-8')}```\n"
        )
        files.append(File.generated(config, f"gallery/{script.stem}.md", content=text))
        files.append(
            File.generated(
                config, f"gallery/{script.stem}.svg", content=picture(script).read_bytes()
            )
        )
        index += [
            "<div markdown>",
            "",
            f"## [{title}]({script.stem}.md)",
            "",
            about,
            "",
            f"[![{about}]({script.stem}.svg)]({script.stem}.md)",
            "",
            "</div>",
            "",
        ]
    files.append(File.generated(config, "gallery/index.md", content="\n".join([*index, "</div>"])))
    return files


def on_page_markdown(markdown: str, page: Any, **_rest: Any) -> str:
    """Return the text of a page with its tables in full, and with the references that are made from
    the code.
    """
    sys.path.append(str(DOCS))
    from pages import in_full

    from mapmore_cli.modelling.literature import reference as formulas
    from mapmore_cli.storage.artefacts.reference import described
    from mapmore_cli.study.schema import reference as keys

    made = {"keys": keys, "formulas": formulas, "files": described}
    return re.sub(
        r"<!-- made: (\w+) -->",
        lambda match: made[match[1]](),
        in_full(markdown, page.file.src_path),
    )


SHIM = "https://unpkg.com/iframe-worker/shim"
"""The theme's one script of another server."""


def on_post_page(output: str, page: Any, **_rest: Any) -> str:
    """Return the page with that script replaced by our own, so that it needs no network."""
    return output.replace(SHIM, "../" * page.url.count("/") + "worker.js")


def on_post_template(output_content: str, **_rest: Any) -> str:
    """Return a page that has no source, as that of links that lead nowhere, with the same
    change.
    """
    return output_content.replace(SHIM, "worker.js")
