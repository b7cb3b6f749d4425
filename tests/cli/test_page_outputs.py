"""What pages show below a command is what the command prints; see `page_outputs`."""

import re
import shutil
from pathlib import Path

import pytest
import yaml
from page_outputs import FENCE, Call, difference, run_page, steps_of

DOCS = Path(__file__).parents[2] / "docs"
FIRST = "first-model"
AFTER_FIRST = (
    "how-mapmore-builds-a-model",
    "which-model",
    "how-good",
    "how-sure",
    "beyond-the-data",
    "from-model-to-paper",
)
"""Pages that go on with the example study, which has run already."""

ALONE = ("install", "your-own-data", "models-with-memory")
"""Pages that begin in an empty folder."""


@pytest.fixture(scope="module")
def after_first(tmp_path_factory, mapmore):
    """The folder in which the commands of the first page have run."""
    folder = tmp_path_factory.mktemp("first")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        run_page(DOCS / f"{FIRST}.md", mapmore)
    return folder


def test_the_first_page_shows_what_its_commands_print(after_first):
    assert (after_first / "runs" / "muscle" / "model.h5").is_file()


def test_pieces_of_the_spec_are_those_of_the_example(after_first):
    study = yaml.safe_load((after_first / "muscle" / "study.yaml").read_text(encoding="utf-8"))
    for page in (
        *(DOCS / f"{name}.md" for name in (FIRST, "how-mapmore-builds-a-model", "index")),
        DOCS.parent / "README.md",
    ):
        text = page.read_text(encoding="utf-8")
        blocks = [yaml.safe_load(block) for name, block in FENCE.findall(text) if name == "yaml"]
        # a block that extends another spec is a spec of its own
        pieces = {k: v for block in blocks if "extends" not in block for k, v in block.items()}
        assert len(pieces) >= 2
        assert pieces == {name: study[name] for name in pieces}


@pytest.mark.parametrize("page", AFTER_FIRST)
def test_a_page_that_goes_on_with_the_example(page, after_first, mapmore, tmp_path):
    shutil.copytree(after_first, tmp_path, dirs_exist_ok=True)
    run_page(DOCS / f"{page}.md", mapmore)


@pytest.mark.parametrize("page", ALONE)
@pytest.mark.usefixtures("tmp_path")
def test_a_page_that_begins_in_an_empty_folder(page, mapmore):
    run_page(DOCS / f"{page}.md", mapmore)


NUMBER = re.compile(r"(?<![\w.])\d+\.\d+(?![\w.]*\w)")
SHOWN = re.compile(r"^```\w*\n.*?^```|<!-- table .*?<!-- end -->", re.MULTILINE | re.DOTALL)
OTHER = re.compile(r"<!-- cell .*?<!-- / -->|`[^`]*`|section \d+\.\d+", re.DOTALL)


@pytest.mark.parametrize("page", [FIRST, *AFTER_FIRST, *ALONE[1:], "structure-search"])
def test_numbers_in_sentences_are_shown_on_the_page(page):
    """Each number of three digits or more is one that a block of the page shows, or its rounding:
    so a sentence cannot keep a number that a command does not print any more.
    """
    text = (DOCS / f"{page}.md").read_text(encoding="utf-8")
    shown = {float(number) for number in NUMBER.findall(" ".join(SHOWN.findall(text)))}
    for number in NUMBER.findall(OTHER.sub("", SHOWN.sub("", text))):
        if len(number.replace(".", "").lstrip("0")) >= 3:
            digits = len(number.partition(".")[2])
            assert any(abs(one - float(number)) <= 0.51 * 10**-digits for one in shown), number


def test_a_session_is_read_from_top_to_bottom():
    page = "```yaml\n# a/b.yaml\nx: 1\n```\n```console\n$ one \\\n    two\nout\n...\n$ three\n```\n"
    named, first, second = steps_of(page)
    assert named == ("a/b.yaml", "# a/b.yaml\nx: 1\n")
    assert isinstance(first, Call)
    assert first.command.split() == ["one", "two"]
    assert first.shown == ("out", "...")
    assert second.shown == ()


def test_a_line_that_is_not_printed_is_found():
    printed = ["a  1", "b  2", "c  3 and more"]
    assert difference(["a 1", "...", "c 3 ..."], printed) == {}
    assert difference(["b 3"], printed) == {"b 3": "b  2"}
    assert difference(["b 2", "a 1"], printed).keys() == {"a 1"}  # in their order
