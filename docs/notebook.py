"""Execute docs/notebook.ipynb, cell by cell, without IPython: the site shows what its cells answer,
a test asks it.
"""

from __future__ import annotations

import ast
import contextlib
import io
import json
import os
from base64 import b64encode
from pathlib import Path
from typing import Any

NOTEBOOK = Path(__file__).with_name("notebook.ipynb")


def executed(path: Path = NOTEBOOK) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Return the notebook's cells, each code cell with its outputs as notebooks have them, and the
    names that it defines.

    The last expression of a cell is its answer; figures that were drawn follow. Cells run in the
    notebook's folder.
    """
    import matplotlib.pyplot as plt

    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    scope: dict[str, Any] = {"__name__": "__main__"}
    with contextlib.chdir(path.parent):
        for cell in (one for one in cells if one["cell_type"] == "code"):
            cell["outputs"] = [
                *_answers("".join(cell["source"]), scope),
                *(_picture(plt.figure(number)) for number in plt.get_fignums()),
            ]
            plt.close("all")
    return cells, scope


def _answers(source: str, scope: dict[str, Any]) -> list[dict[str, Any]]:
    tree = ast.parse(source)
    last = tree.body[-1].value if isinstance(tree.body[-1], ast.Expr) else None
    tree.body[-1:] = tree.body[-1:] if last is None else []
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(compile(tree, "cell", "exec"), scope)
        value = None if last is None else eval(compile(ast.Expression(last), "cell", "eval"), scope)
    found: list[dict[str, Any]] = (
        [{"output_type": "stream", "name": "stdout", "text": text}]
        if (text := printed.getvalue())
        else []
    )
    if value is not None:
        html = {"text/html": value._repr_html_()} if hasattr(value, "_repr_html_") else {}
        found.append(
            {
                "output_type": "execute_result",
                "metadata": {},
                "data": {"text/plain": repr(value), **html},
            }
        )
    return found


def _picture(figure: Any) -> dict[str, Any]:
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=100)
    return {
        "output_type": "display_data",
        "metadata": {},
        "data": {"image/png": b64encode(stream.getvalue()).decode()},
    }


def markdown() -> str:
    """Return the executed notebook as a page."""
    os.environ.setdefault("MPLBACKEND", "agg")
    parts = []
    for cell in executed()[0]:
        source = "".join(cell["source"])
        parts.append(source if cell["cell_type"] == "markdown" else f"```python\n{source}\n```")
        for output in cell.get("outputs", []):
            data = output.get("data", {"text/plain": output.get("text", "")})
            if "image/png" in data:
                parts.append(
                    '<img alt="what the cell draws" '
                    f'src="data:image/png;base64,{data["image/png"]}">'
                )
            else:
                parts.append(
                    data.get("text/html") or f"```text\n{data['text/plain'].rstrip()}\n```"
                )
    return "\n\n".join(
        [*parts, f"[{NOTEBOOK.name}]({NOTEBOOK.name}) is the notebook; a test executes it.", ""]
    )
