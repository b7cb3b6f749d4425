"""Show tables in full when the site is built, and take the search's script from the site itself."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parents[1]


def on_config(config: Any) -> Any:
    """Show the version in the head of every page."""
    from mapmore_cli import __version__

    config.site_name = f"mapmore {__version__}"
    return config


def on_page_markdown(markdown: str, page: Any, **_rest: Any) -> str:
    """Return the text of a page with its tables in full."""
    sys.path.append(str(DOCS))
    from pages import in_full

    return in_full(markdown, page.file.src_path)


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
