"""docs/figures-for-papers.md: its spec is a spec, and its commands are commands."""

import re
import shlex
from pathlib import Path

import yaml
from page_tables import DOCS, block_of

PAGE = DOCS / "figures-for-papers.md"


def test_what_the_page_says_works(study, mapmore):
    document = yaml.safe_load(study.read_text())
    document["report"] = {**yaml.safe_load(block_of(PAGE))["report"], "figures": ["fit"]}
    study.write_text(yaml.safe_dump(document))
    mapmore("run", study, "-q", code=0)
    report = Path("runs", "bench", "report")
    assert (report / "panels" / "fit.pressure=200.pgf").is_file()
    assert (report / "tables" / "scores.tex").is_file()
    text = PAGE.read_text(encoding="utf-8")
    lines = re.findall(r"mapmore (figure muscle [^`\n]+)", text)
    assert len(lines) == 3
    ours = {"muscle": "bench", "350": "200", "sarosi": "polynomial_2"}
    for line in lines:
        here = re.sub("|".join(ours), lambda found: ours[found[0]], line)
        mapmore(*shlex.split(here), code=0)
        [drawn] = [*Path.cwd().glob("*.pdf"), *Path.cwd().glob("*.svg")]
        drawn.unlink()
    assert Path("fig3.csv").is_file()
