"""Questions on a terminal: the likeliest answer first, Enter takes it."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from mapmore_cli.domain.errors import UsageError
from mapmore_cli.study.drafting.answers import Question

console = Console(stderr=True, highlight=False)


def ask(question: Question) -> str:
    """Print a question with its options, and return the first answer that can be; the end of the input takes the first option."""
    console.print(f"\n[bold]{escape(question.text)}[/bold]")
    for number, option in enumerate(question.options, start=1):
        console.print(f"  {number} [bold]{escape(option.text)}[/bold]  {option.course}")
        console.print(f"    [dim]{escape(option.why)}[/dim]")
    while True:
        console.print(f"[dim]Enter for 1{', else ' + escape(question.form) if question.form else ''}[/dim] > ", end="")
        try:
            reply = input()
        except EOFError:
            return ""
        try:
            question.check(reply)
        except UsageError as fault:
            console.print(f"[red]{escape(fault.message)}[/red]: {escape(fault.remedy or '')}")
            continue
        return reply
