"""`mapmore schema`: the JSON Schema of the spec, for editors."""

from __future__ import annotations


def schema() -> None:
    """Print the JSON Schema of the experiment spec."""
    from mapmore_cli.cli.console import print_document
    from mapmore_cli.spec.schema import json_schema

    print_document(json_schema())
