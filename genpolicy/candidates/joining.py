"""How a new chunk joins the plan that it takes over from: one rule, equal for all methods.

`replace` takes the chunk as it is. The ensembling rules blend it with what earlier invocations
predicted for the same moments (Zhao et al., arXiv 2304.13705); the published codes differ in which
prediction weighs most, so there are two names. `running_average` blends each new prediction into
what was blended before, as LeRobot's asynchronous client fills its queue. `bidirectional` chooses
among the candidates the one that is nearest to the previous plan (Liu et al., arXiv 2408.17355, the
backward term). `real_time` draws the candidates so that they go on from it (Black et al., arXiv
2506.07339). `warm_start` starts drawing them at what is left of it, with noise of an intermediate
time of the sampler's path, in place of noise alone; the earlier steps are saved.
Whatever comes out is a proposal without any authority.
"""

from typing import Literal

from pydantic import Field

from genpolicy.candidates.selector import SELECTOR
from genpolicy.contract.settings import Settings
from genpolicy.errors import ConfigError
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes

REPLACE, BIDIRECTIONAL, REAL_TIME = "replace", "bidirectional", "real_time"
WARM_START = "warm_start"
DRAWN_ON = (REAL_TIME, WARM_START)
"""Rules that ask the sampler itself for chunks that go on from the previous plan."""
ENSEMBLE_OLDEST, ENSEMBLE_NEWEST = "ensemble_oldest", "ensemble_newest"
RUNNING_AVERAGE = "running_average"
BLENDS = (ENSEMBLE_OLDEST, ENSEMBLE_NEWEST, RUNNING_AVERAGE)
"""Rules that make a chunk of several predictions."""
READS = {
    REPLACE: (), ENSEMBLE_OLDEST: ("decay",), ENSEMBLE_NEWEST: ("decay",),
    RUNNING_AVERAGE: ("newest",), BIDIRECTIONAL: ("decay",), REAL_TIME: ("guidance",),
    WARM_START: ("strength",),
}  # fmt: skip
"""What each rule reads of the settings, beside its name."""


class JoiningSettings(Settings):
    """Setting `stress.joining`: the rule of all methods, in the comparison and where it is timed.

    Attributes:
        rule: `replace`; `ensemble_oldest` (ACT: the oldest prediction weighs most) or
            `ensemble_newest` (Reactive Diffusion: the newest does); `running_average`;
            `bidirectional`; `real_time`; `warm_start`.
        decay: Weights fall by exp(-decay) from one prediction to the next, and in `bidirectional`
            from row to row; 0.01 as published for ACT.
        newest: Share of the newest prediction in `running_average`, all before it have the rest:
            LeRobot's `weighted_average` is 0.7, `average` 0.5, `conservative` 0.3. Its
            `latest_only` is `replace`.
        guidance: Largest factor of the guidance of `real_time`; 5 as published.
        strength: Share of a sampler's steps that `warm_start` takes, rounded up to a whole step;
            1 takes all of them from noise alone, as `replace` does.
        exempt: Methods that take `replace` under `real_time` and `warm_start`, since no path leads
            from noise to their chunks; each of them is named, and no other.
    """

    rule: Literal[
        "replace", "ensemble_oldest", "ensemble_newest", "running_average", "bidirectional",
        "real_time", "warm_start",
    ] = "replace"  # fmt: skip
    decay: float = Field(default=0.01, ge=0.0, le=10.0)
    newest: float = Field(default=0.7, gt=0.0, lt=1.0)
    guidance: float = Field(default=5.0, gt=0.0, le=100.0)
    strength: float = Field(default=0.5, gt=0.0, le=1.0)
    exempt: list[str] = Field(default_factory=list)

    @property
    def starts_at(self) -> float | None:
        """Strength of the warm start; None under a rule that starts from noise alone."""
        return self.strength if self.rule == WARM_START else None

    def of(self, method: str, *, guided: bool) -> "JoiningSettings":
        """What holds for a method.

        Args:
            method: Its name.
            guided: Whether its sampler has a path that can be guided, or started on.

        Raises:
            ConfigError: A rule of `DRAWN_ON` for a method that cannot and is not named as exempt,
                or that can and is.
        """
        if self.rule not in DRAWN_ON:
            return self
        if (method in self.exempt) == guided:
            does, did = (
                ("guide", "guided") if self.rule == REAL_TIME else ("start on", "started on")
            )
            can = f"can be {did}" if guided else f"has no path from noise to {does}"
            raise ConfigError(
                where=f"stress.joining.exempt and {method}",
                found=f"a method that {can}, {'named' if guided else 'not named'}",
                expected=f"just the methods that cannot take `{self.rule}`",
                action=f"{'Remove' if guided else 'Add'} {method!r}, or choose another rule.",
            )
        return self.named(method)

    def named(self, method: str) -> "JoiningSettings":
        """The same as it is written, for whoever cannot ask the sampler."""
        exempt = self.rule in DRAWN_ON and method in self.exempt
        return JoiningSettings() if exempt else self

    def sampler_hash(self, own: str) -> str:
        """Identity of a sampler whose chunks join by this rule: a chunk of another is refused.

        Args:
            own: SHA-256 of the sampler's settings; it stays as it is under `replace`.
        """
        if self.rule == REPLACE:
            return own
        read = {name: getattr(self, name) for name in READS[self.rule]}
        return sha256_bytes(canonical_json({"sampler": own, "joining": self.rule, **read}))

    def said(self) -> str:
        """Selector and rule, in words for an identity card."""
        if self.rule == REPLACE:
            return SELECTOR
        read = "".join(f", {name} {getattr(self, name):g}" for name in READS[self.rule])
        return f"{SELECTOR}; joined by {self.rule}{read}"
