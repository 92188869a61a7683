"""The command `genpolicy`."""


def main() -> int:
    """Entry point of the console script."""
    raise NotImplementedError
