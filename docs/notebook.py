"""Execute docs/notebook.ipynb, cell by cell, without IPython, and write its outputs into it and
into the page notebook.md.
"""

from __future__ import annotations

import ast
import contextlib
import io
import json
import os
from base64 import b64decode, b64encode
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
                "execution_count": None,
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


def write_notebook() -> None:
    """Execute the notebook; write it with its outputs, its page, and the pictures of the page."""
    os.environ.setdefault("MPLBACKEND", "agg")
    notebook = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    notebook["cells"], _ = executed()
    NOTEBOOK.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", "utf-8")
    page, pictures = markdown(notebook["cells"])
    NOTEBOOK.with_suffix(".md").write_text(page, encoding="utf-8")
    for name, content in pictures.items():
        (NOTEBOOK.parent / "figures" / name).write_bytes(content)


def markdown(cells: list[dict[str, Any]]) -> tuple[str, dict[str, bytes]]:
    """Return executed cells as a page, and the pictures that it shows by their names."""
    parts, pictures = list[str](), dict[str, bytes]()
    for cell in cells:
        source = "".join(cell["source"])
        parts.append(source if cell["cell_type"] == "markdown" else f"```python\n{source}\n```")
        for output in cell.get("outputs", []):
            data = output.get("data", {"text/plain": output.get("text", "")})
            if "image/png" in data:
                name = f"notebook-{len(pictures) + 1}.png"
                pictures[name] = b64decode(data["image/png"])
                parts.append(f"![Figure that the cell above draws](figures/{name})")
            else:
                parts.append(f"```text\n{data['text/plain'].rstrip()}\n```")
    end = f"This page shows the notebook [{NOTEBOOK.name}]({NOTEBOOK.name}); a test executes it."
    return "\n\n".join([*parts, f"{end}\n"]), pictures
