"""Specs that are written for people: short, on one line where it fits, with the line for
editors.
"""

from spec_examples import STATIC

from mapmore_cli.study.loader import load
from mapmore_cli.study.yaml_dumper import dump

MODELINE = "# yaml-language-server: $schema="


def test_what_is_short_stands_on_one_line():
    ends = {
        "ends": {"of": "strain", "widths": [0.03, 0.1, 0.3], "with": ["pressure", "pressure^2"]}
    }
    text = dump(
        {
            "dictionary": [{"polynomial": {"of": ["strain", "pressure"], "order": 2}}, ends],
            "fit": {"max_terms": 8, "stop": "bic"},
        }
    )
    assert text.splitlines() == [
        "dictionary:",
        "- polynomial: {of: [strain, pressure], order: 2}",
        "- ends: {of: strain, widths: [0.03, 0.1, 0.3], with: [pressure, pressure^2]}",
        "fit: {max_terms: 8, stop: bic}",
    ]
    assert dump({"a": 1}) == "a: 1\n"
    full, longer = 73 * "x", 74 * "x"  # with their key and the braces, 80 and 81 characters
    assert dump({"k": {"a": full}}) == f"k: {{a: {full}}}\n"
    assert dump({"k": {"a": longer}}) == f"k:\n  a: {longer}\n"


def test_the_line_for_editors_leads_from_the_new_place(tmp_path):
    folder = tmp_path / "studies"
    folder.mkdir()
    (folder / "a.yaml").write_text(f"{MODELINE}../experiment.schema.json\n{STATIC}")
    loaded = load(folder / "a.yaml")
    found = tmp_path / "runs" / "a"
    assert (
        loaded.resolved_in(found, given_only=True).splitlines()[0]
        == f"{MODELINE}../../experiment.schema.json"
    )
    assert not loaded.resolved_in(found).startswith("#")
    (folder / "b.yaml").write_text(f"{MODELINE}https://example.org/s.json\n{STATIC}")
    assert (
        load(folder / "b.yaml")
        .resolved_in(found, given_only=True)
        .startswith(f"{MODELINE}https://example.org/s.json\n")
    )
