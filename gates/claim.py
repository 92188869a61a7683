"""What a verdict on a candidate is about: the checkpoint that was run, not the method it is of."""

CHECKPOINT_ONLY = (
    "This checkpoint only: no test here has training seeds as its unit, so nothing is claimed of "
    "the method, and another training of it may pass or fail."
)
ONE_OF_SEVERAL = (
    "The verdict and the promotion are of one checkpoint, that of the first training seed, which "
    "was named before a rollout; no criterion has training seeds as its unit. What a method is "
    "worth over its trainings is told as `This method` and decides nothing."
)
"""In the place of `CHECKPOINT_ONLY` where further trainings were rolled out."""
IN_SHORT = "this checkpoint only"
SHOWN = "shown, not judged"
"""Of a number beside the one that is held against a limit."""
MEDIAN_PASSES = "median of the neighbours passes in"
"""Before the situations in which it does, and how many there are."""


def trainings(seeds: int) -> str:
    """Of how many trainings a number is."""
    return f"of {seeds} training seed{'s' * (seeds > 1)}"
