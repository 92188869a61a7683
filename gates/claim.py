"""What a verdict on a candidate is about: the checkpoint that was run, not the method it is of."""

CHECKPOINT_ONLY = (
    "This checkpoint only: no test here has training seeds as its unit, so nothing is claimed of "
    "the method, and another training of it may pass or fail."
)
IN_SHORT = "this checkpoint only"
