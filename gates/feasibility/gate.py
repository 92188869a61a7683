"""Gate C as a whole: its criteria in the order of the questions."""

from gates.criterion import criteria_of
from gates.engine import GateSpec
from gates.feasibility import arrivals, candidates, incidents, proof
from gates.feasibility.settings import JOURNALS, SHADOW, FeasibilitySettings

GATE = GateSpec(
    gate="C",
    settings=FeasibilitySettings,
    criteria=criteria_of(vars(candidates), vars(arrivals), vars(incidents), vars(proof)),
    bind=(JOURNALS, f"{SHADOW}/gallery.json"),
    back_to="the generator or the projection",
    go_on="Compare every passing candidate with the simpler policies on identical starts.",
    caveats=(
        "Shadow runs execute nothing; closed-loop effects are the matter of gate D.",
        "Corrupted fixtures and incidents are those listed; another one is not covered.",
    ),
    below="B",
)
