"""Give the package its description: README with addresses that work on a package index.

The environment variable `MAPMORE_REPOSITORY` names the repository, as `https://host/owner/mapmore`.
Without it the links stay relative, as they are right in an unpacked archive.
"""

import os
import re
from pathlib import Path

from setuptools import setup

LINK = re.compile(r"(!?)(\[[^\]]*\])\((?!https?:|#)([^)\s]+)\)")


def described(text: str, repository: str) -> str:
    """Return a Markdown text in which links and pictures are addresses in a repository."""
    if not repository:
        return text
    base = repository.rstrip("/")
    return LINK.sub(
        lambda link: f"{link[1]}{link[2]}({base}/{'raw' if link[1] else 'blob'}/main/{link[3]})",
        text,
    )


if __name__ == "__main__":
    readme = (Path(__file__).parent / "README.md").read_text(encoding="utf-8")
    setup(
        long_description=described(readme, os.environ.get("MAPMORE_REPOSITORY", "")),
        long_description_content_type="text/markdown",
    )
