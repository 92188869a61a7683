"""How far an audit is: called after every item, so that a command can show it."""

from collections.abc import Callable

Progress = Callable[[str, int, int], None]


def silent(what: str, done: int, total: int) -> None:
    """Show nothing.

    Args:
        what: What is counted.
        done: Items done.
        total: Items in all.
    """
