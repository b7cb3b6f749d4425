"""The files of a campaign's page, of which a later page may have fewer."""

import json
from hashlib import sha256

from mapmore_cli.annexes.campaigns.page import _ways_made


def test_files_that_a_page_no_longer_has_are_removed_unless_somebody_changed_them(tmp_path):
    folder = tmp_path / "camp"
    (folder / "tables").mkdir(parents=True)
    names = ["index.html", "nrmse.svg", "tables/a.csv", "tables/changed.csv", "../beside.csv"]
    for name in names:
        (folder / name).write_text("old")
    files = {name: [sha256(b"old").hexdigest()] for name in names}
    (folder / "campaign.json").write_text(json.dumps({"files": files}))
    (folder / "tables" / "changed.csv").write_text("mine")
    (folder / "tables" / "added.csv").write_text("old")
    made = _ways_made(folder, {"index.html": "new"}, lambda _message: None)
    assert made == {"index.html": [sha256(b"new").hexdigest(), *files["index.html"]]}
    left = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    kept = {"index.html", "campaign.json", "tables/changed.csv", "tables/added.csv"}
    assert left == kept
    assert (tmp_path / "beside.csv").is_file()
