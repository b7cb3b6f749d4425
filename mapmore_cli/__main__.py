"""Start the command line, as `mapmore` or as `python -m mapmore_cli`. The package is imported
inside of `main`, so that Ctrl-C is handled even while modules are imported.
"""

from __future__ import annotations

import gc
import os
import sys

YOUNG = 200_000
"""Number of objects between garbage collections. Objects that imports create live as long as the
program, and scanning them repeatedly would take a tenth of its time.
"""


def main() -> None:
    """Run the command line. Ctrl-C ends it at any time with exit code 130 and without a
    traceback.
    """
    try:
        _hold_standard_streams()
        gc.set_threshold(YOUNG)
        from mapmore_cli import THREADS

        # one thread only, because a process with several threads cannot be forked safely
        os.environ |= dict.fromkeys(THREADS, "1")

        from mapmore_cli.cli.app import main as run

        run()
    except (KeyboardInterrupt, SystemError) as end:
        if isinstance(end, SystemError) and not isinstance(end.__cause__, KeyboardInterrupt):
            raise
        print("interrupted", file=sys.stderr)  # Ctrl-C inside a C function raises SystemError
        sys.exit(130)


def _hold_standard_streams() -> None:
    """Open the null device in place of each standard stream that is closed. Otherwise, the next
    file that is opened would get the file descriptor of this stream. With the null device, reading
    from stdin and writing to stdout fail, and messages on stderr are lost.
    """
    for number, name, way in (
        (0, "stdin", os.O_WRONLY),
        (1, "stdout", os.O_RDONLY),
        (2, "stderr", os.O_WRONLY),
    ):
        if getattr(sys, name) is None:
            nowhere = os.open(os.devnull, way)
            if nowhere != number:
                os.dup2(nowhere, number)
                os.close(nowhere)
            mode = "w" if number else "r"
            stream = os.fdopen(number, mode, encoding="utf-8", errors="replace")
            setattr(sys, name, stream)


if __name__ == "__main__":  # this is False in worker processes
    main()
