"""Title and caption of the figures that more than one page shows: one figure, one explanation."""

CLUSTERS = (
    "Nearest observations and what was done",
    "Three held-out situations, chosen evenly over how far apart their chunks lie. Above: each "
    "mark is a demonstration, to the right the less alike its observation, up and down what was "
    "done next. Bundles that stay apart down to distance 0 are several actions for one "
    "observation. Below: the chunks themselves; dashed their mean.",
)
REALIGNMENT = (
    "Before and after realignment",
    "Clock of every episode against the others, in the order of recording where one is known: by "
    "how much what is observed trails what was commanded, compared with the usual. Modes that "
    "vanish after realignment were a defect of the data.",
)
STRATA = (
    "What explains the modes",
    "Share of the uncertainty (entropy) about the mode that each variable removes: bar the "
    "estimate, line its interval. Grey: not significant after Holm's correction. A red bar beyond "
    "the limit means: give this variable to the policy, or standardise it, instead.",
)
LABELS = (
    "Labels against replay",
    "Replayed episodes by the mode that they followed. A mode whose labels do not hold is a "
    "contaminated target, not a mode.",
)
