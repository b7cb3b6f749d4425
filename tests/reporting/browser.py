"""Opens a page of hostile names: `python tests/reporting/browser.py [CHROMIUM]` ends with 1 where a
script ran or a request left the page.

Two pages are the controls: one into which the same text was put as markup, with the page's
Content-Security-Policy and without it. Without it, the text does what it says, or this program
would find nothing anywhere.
"""

import subprocess
import sys
import threading
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1]))

from report_builder import all_named
from test_reporting_page import EVERYTHING, write_report

OWNED = "owned"


@contextmanager
def server():
    """A server on this machine: its port, and the paths that were asked for."""
    asked = []

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            asked.append(self.path)
            self.send_response(200)
            self.end_headers()

        def log_message(self, format, *arguments):
            pass

    with HTTPServer(("127.0.0.1", 0), Handler) as http:
        threading.Thread(target=http.serve_forever, daemon=True).start()
        yield http.server_port, asked
        http.shutdown()


def hostile(port):
    """A name that runs scripts and asks a server for a picture and a style, where it is taken for
    markup.
    """
    leak, change = f"http://127.0.0.1:{port}", f"document.title='{OWNED}'"
    picture = f'<img src=\'{leak}/picture\' onerror="{change}">"><svg onload={change}>'
    return f"<script>{change}</script>{picture}<style>@import url({leak}/style)</style>"


def write_page(folder, name):
    """A report in which everything has that name."""
    write_report(all_named(name), folder, **EVERYTHING)
    return folder / "index.html"


def title_of(browser, page):
    """The title of a page, after its scripts have run."""
    call = [
        browser,
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--virtual-time-budget=3000",
        "--dump-dom",
        page.as_uri(),
    ]
    dom = subprocess.run(call, check=True, capture_output=True, text=True, timeout=120).stdout
    return dom.partition("<title>")[2].partition("</title>")[0]


def main(browser):
    """Print what became of each page; 1 where a page did what its names say, or the control did
    not.
    """
    with server() as (port, asked), TemporaryDirectory() as place:
        name = hostile(port)
        page = write_page(Path(place), name)
        injected = page.read_text(encoding="utf-8").replace("<body>", f"<body>{name}")
        (page.parent / "injected.html").write_text(injected, encoding="utf-8")
        (page.parent / "control.html").write_text(
            injected.replace("Content-Security-Policy", "X-No-Policy"), encoding="utf-8"
        )
        harmed = {}
        for what in ("index", "injected", "control"):
            asked.clear()
            owned = title_of(browser, page.with_name(f"{what}.html")) == OWNED
            harmed[what] = owned or bool(asked)
            print(f"{what}: script {'ran' if owned else 'did not run'}, {len(asked)} requests")
    return 0 if harmed == {"index": False, "injected": False, "control": True} else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1] if len(sys.argv) > 1 else "chromium"))
