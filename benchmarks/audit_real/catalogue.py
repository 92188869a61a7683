"""Every base and every change, and the cases that are made of them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

from benchmarks.audit_real.bases import arms, planar, published, real
from benchmarks.audit_real.changes.change import Change, Place
from benchmarks.audit_real.changes.columns import COLUMN_CHANGES, DECIDED
from benchmarks.audit_real.changes.defects import DEFECTS
from benchmarks.audit_real.changes.forms import FORMS
from benchmarks.audit_real.changes.more import LATER, MORE
from benchmarks.audit_real.changes.said import SAID
from benchmarks.audit_real.changes.time import TIMES
from benchmarks.audit_real.plan import Plan
from benchmarks.audit_real.recording import Recording
from genpolicy.seeds import stream

AS_IS = "as it is"
# One recording in another order or under other names: the verdict must be the same.
ORDER_AND_NAMES = (
    AS_IS, "episodes shuffled", "episodes in reverse", "columns in another order", "names absent",
    "names are nonsense", "only one name shared",
)  # fmt: skip
BASES: dict[str, Callable[[Plan], Recording]] = {
    "avoiding": planar.avoiding,
    "goals": planar.goals,
    "pushing": planar.pushing,
    "arm": arms.arm,
    "arm_two": arms.arm_two,
    "planner": arms.planner,
    "humanoid": arms.humanoid,
    "aloha": published.aloha,
    "blocks": published.blocks,
    "kitchen": published.kitchen,
    # Last, so that the seeds of the others do not depend on whether these lie here.
    **({"pusht": real.pusht, "g1": real.g1} if real.here() else {}),
}
CHANGES: dict[str, Change] = {
    change.name: change
    for change in (*FORMS, *DECIDED, *COLUMN_CHANGES, *TIMES, *DEFECTS, *MORE, *SAID, *LATER)
}
# Two changes at once: a defect beside what decides, a form beside either, names beside all.
CROSSINGS = (
    ("delta", "zq7 decides"), ("delta, names of the state", "task decides"),
    ("velocity", "a sign flipped"), ("names absent", "two columns swapped"),
    ("names absent", "a third in another unit"), ("scenario decides", "a third in another unit"),
    ("outcomes absent", "a third in another unit"), ("waits at first", "hand decides"),
    ("waits at first", "glued to a copy"), ("30 recorded columns of noise", "zq7 decides"),
    ("30 observed columns of noise", "lag in half"), ("constant commanded column", "lag in half"),
    ("constant commanded column", "task decides"),
    ("outcomes absent", "latent decides, in every row"),
    ("outcomes absent", "a sign flipped"), ("two collections merged, one first", "zq7 decides"),
    ("signs of quaternions", "scenario decides"), ("normalised", "lag in half"),
    ("episodes shuffled", "names absent"), ("no clock", "two columns swapped"),
    ("only one name shared", "hand decides"), ("leader of another build", "a sign flipped"),
    ("outcomes absent", "names absent"), ("columns in another order", "lag in half"),
    ("waits at first", "what decides is observed"), ("delta", "what decides is observed"),
    ("as robomimic", "delta"), ("as Parquet files", "task decides"), ("as LeRobot v3", "velocity"),
    ("as one Parquet table", "two columns swapped"), ("as LeRobot v2.1", "zq7 decides"),
)  # fmt: skip


@dataclass(frozen=True)
class Case:
    """One recording to be audited.

    Attributes:
        base: Name of the base.
        changes: Names of the changes, with the strength of each.
        seed: Seed of the base and of every draw of the changes.
    """

    base: str
    changes: tuple[tuple[str, float], ...]
    seed: int

    @property
    def title(self) -> str:
        """Base and changes in words."""
        return f"{self.base}/{self.change}"

    @property
    def change(self) -> str:
        """The changes in words."""
        return " + ".join(
            f"{name} {strength:.3g}" if CHANGES[name].unit else name
            for name, strength in self.changes
        )


def made(case: Case, *, episodes: int | None = None) -> Recording:
    """The recording of a case, with its truth; a small one has the same truth."""
    plan = Plan(case.seed, episodes=episodes)
    ordered = sorted(case.changes, key=lambda item: CHANGES[item[0]].stage)
    for name, strength in ordered:
        plan = CHANGES[name].plan(plan, strength)
    recording = BASES[case.base](plan)
    for number, (name, strength) in enumerate(ordered):
        rng = stream(case.seed, "audit_real", "change", name, number)
        place = Place(BASES[case.base], plan, rng)
        recording = CHANGES[name].apply(recording, place, strength)
    return recording


@lru_cache
def base_of(name: str) -> Recording:
    """The base as it is, to ask what fits it."""
    return BASES[name](Plan(0, episodes=24))


def fits(base: str, names: Sequence[str]) -> bool:
    """Whether these changes make sense of a base, one after the other."""
    recording = base_of(base)
    for name in sorted(names, key=lambda item: CHANGES[item].stage):
        change = CHANGES[name]
        if not change.fits(recording):
            return False
        place = Place(BASES[base], Plan(0, episodes=24), stream(0, "fits"))
        if not name.startswith("two collections"):
            recording = change.apply(recording, place, change.strengths[0])
        if change.plan(Plan(0), 1.0) != Plan(0):
            recording = replace(
                recording,
                truth=replace(recording.truth, decided_by=change.plan(Plan(0), 1.0).decided_by),
            )
    return True


def development(first_seed: int) -> list[Case]:
    """Every base with every change that fits it, once at a strength in turn, and the crossings."""
    found = []
    for place, base in enumerate(BASES):
        for number, (name, change) in enumerate(CHANGES.items()):
            if fits(base, [name]):
                strength = change.strengths[(place + number) % len(change.strengths)]
                found.append(Case(base, ((name, strength),), first_seed + place))
        for pair in CROSSINGS:
            if fits(base, pair):
                both = tuple((name, CHANGES[name].strengths[0]) for name in pair)
                found.append(Case(base, both, first_seed + place))
    return found


def report(first_seed: int, *, singles: int = 26, crossings: int = 10) -> list[Case]:
    """Cases drawn from a seed that nobody knew while the detector was made.

    Each base as it is, with so many changes of a strength drawn from those stated, and with so many
    crossings of any two that fit; each has data of its own, but for changes of order and names,
    which are made on the data of the base as it is.

    Args:
        first_seed: Root of the draws and first seed of the data.
        singles: Changes of each base.
        crossings: Crossings of each base.
    """
    found = []
    for place, base in enumerate(BASES):
        rng = stream(first_seed, "audit_real", "report", base)
        names = [name for name in CHANGES if name != AS_IS and fits(base, [name])]
        chosen = [(names[int(k)],) for k in rng.permutation(len(names))[:singles]]
        pairs: list[tuple[str, ...]] = []
        while len(pairs) < crossings:
            pair = tuple(names[int(k)] for k in rng.permutation(len(names))[:2])
            if CHANGES[pair[0]].stage != CHANGES[pair[1]].stage and fits(base, pair):
                pairs.append(pair)
        for number, group in enumerate([(AS_IS,), *chosen, *pairs]):
            same = all(name in ORDER_AND_NAMES for name in group)
            seed = first_seed + 1000 * place + (0 if same else number)
            drawn = tuple((name, float(rng.choice(CHANGES[name].strengths))) for name in group)
            found.append(Case(base, drawn, seed))
    return found
