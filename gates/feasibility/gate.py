"""Gate C as a whole: its criteria in the order of the questions."""

from gates.criterion import criteria_of
from gates.engine import GateSpec
from gates.feasibility import arrivals, candidates, proof
from gates.feasibility.settings import SHADOW, FeasibilitySettings

GATE = GateSpec(
    gate="C",
    settings=FeasibilitySettings,
    criteria=criteria_of(vars(candidates), vars(arrivals), vars(proof)),
    bind=(f"{SHADOW}/journal.mcap",),
    back_to="the generator or the projection",
    go_on="Compare every passing candidate with the simpler policies on identical starts.",
    caveats=(
        "Shadow runs execute nothing; closed-loop effects are the matter of gate D.",
        "Corrupted fixtures are those listed; another corruption is not covered.",
    ),
    below="B",
)
