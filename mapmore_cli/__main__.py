"""`python -m mapmore_cli`."""

from mapmore_cli.cli.app import main

if __name__ == "__main__":  # the worker processes of `batch` import this module again
    main()
