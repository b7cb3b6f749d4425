"""A command: `mapmore hello`. Typer makes its options of the arguments."""


def hello(name: str = "you") -> None:
    """Greet."""
    print(f"hello, {name}")
