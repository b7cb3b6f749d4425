"""What pages cost in Chromium: `python tests/bench/page.py PAGE...` prints a row for each page.

Its size, processor time until it is shown, that of one of 40 moves of the first slider of
"Explore", in a model with memory with the longest course, and the time by the clock until "Explore"
is there.
"""

import shutil
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

MOVES = """() => {
    const move = (slider, value) => {
        slider.value = String(value);
        slider.dispatchEvent(new Event("input", { bubbles: true }));
    };
    const slow = document.querySelector(".explore input[name=frequency]");
    if (slow) move(slow, slow.min);
    const slider = document.querySelector(".explore input[type=range]");
    const [low, high] = [Number(slider.min), Number(slider.max)];
    for (let k = 0; k < 40; k += 1) {
        move(slider, low + ((high - low) * k) / 39);
    }
}"""


def main(pages):
    """Print the rows."""
    print("page, kB, processor ms until shown, of a move, clock ms until Explore")
    with sync_playwright() as driver:
        browser = driver.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox", "--disable-gpu"]
        )
        for page in map(Path, pages):
            tab = browser.new_page()
            session = tab.context.new_cdp_session(tab)
            session.send("Performance.enable", {"timeDomain": "threadTicks"})

            def spent(session=session):
                metrics = session.send("Performance.getMetrics")["metrics"]
                return 1000 * next(m["value"] for m in metrics if m["name"] == "TaskDuration")

            tab.goto(page.resolve().as_uri())
            shown = spent()
            tab.evaluate(MOVES)
            tab.wait_for_timeout(200)
            move = (spent() - shown) / 40
            row = [page.stat().st_size / 1000, shown, move, tab.evaluate("mapmore.shownAfter")]
            print(page.parents[1].name, *(f"{one:.1f}" for one in row), sep=", ")
        browser.close()


if __name__ == "__main__":
    main(sys.argv[1:])
