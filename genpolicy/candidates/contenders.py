"""Who stands in the ladder: trained here or brought, and how each is asked."""

from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from genpolicy.candidates.answering import AnsweringPolicy
from genpolicy.candidates.brought import BroughtPolicy
from genpolicy.candidates.joining import JoiningSettings
from genpolicy.candidates.judged import GENERATORS, JudgedPolicy, compared, trained
from genpolicy.candidates.planned import PlannedPolicy, PlannerPolicy, planned
from genpolicy.candidates.wire.policy import WirePolicy, running
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.contract.observation import ObservationContract
from genpolicy.contract.planner import PLANNER
from genpolicy.policies.policy import NetworkPolicy

Promotable = JudgedPolicy | BroughtPolicy
"""Who may stand for promotion."""
Contender = Promotable | PlannedPolicy
Running = NetworkPolicy | WirePolicy | PlannerPolicy


@contextmanager
def opened(
    candidate: Contender, contract: ObservationContract, *, scene: Path | None = None
) -> Iterator[Running]:
    """A candidate that can be asked, until the end of the block; what it gives up is NaN.

    Args:
        candidate: Who it is.
        contract: The observation in force.
        scene: The MJCF that describes the robot; None where nobody knows it.

    Raises:
        IntegrityError: Its files are not those of its identity.
        BadInputError: Its files are missing or malformed.
    """
    if isinstance(candidate, BroughtPolicy):
        with running(candidate, contract, scene=scene) as policy:
            yield policy
    elif isinstance(candidate, JudgedPolicy):
        yield AnsweringPolicy(candidate.load())
    else:
        yield candidate.load()


def joining_of(rule: JoiningSettings, policy: Running) -> JoiningSettings:
    """How the chunks of a policy that is asked join; of one that did not start, as it is written.

    Raises:
        ConfigError: `real_time` or `warm_start` of one whose chunks cannot go on from given actions
            and that is not named as exempt, or that can and is.
    """
    if isinstance(policy, WirePolicy):
        if policy.absent:
            return rule.named(policy.method)
        # No message says where sampling starts: who is asked over a wire starts from noise.
        return rule.of(policy.method, guided=policy.guided and rule.starts_at is None)
    return rule.of(policy.method, guided=policy.guided)


def admitted_contenders(
    artifacts: Path,
    admitted: Sequence[str],
    brought: Sequence[BroughtPolicy],
    *,
    seed: int,
    device: str,
) -> list[Promotable]:
    """Those that a gate admitted, in its order.

    Args:
        artifacts: Folder of the stages' outputs.
        admitted: Their names.
        brought: Every policy that was brought.
        seed: The training seed that is promoted.
        device: Torch device of those that run here; one that was brought says its own.

    Raises:
        BadInputError: A checkpoint is missing or malformed.
    """
    others = {policy.name: policy for policy in brought}
    own = [name for name in admitted if name not in others]
    ours = trained(artifacts / GENERATORS, own, seeds=[seed], device=device)
    of_ours = {one.name: one for one in ours}
    return [others.get(name) or of_ours[name] for name in admitted]


def in_comparison(
    artifacts: Path,
    *,
    baselines: Sequence[str],
    candidates: Collection[str],
    brought: Sequence[BroughtPolicy],
    seed: int,
    device: str,
    task: str,
    horizons: HorizonConfig,
) -> list[Contender]:
    """Baselines in their order, trained candidates, brought ones: who stands in the comparison.

    Args:
        artifacts: Folder of the stages' outputs.
        baselines: Simpler methods in it.
        candidates: Names of the candidates in it.
        brought: Every policy that was brought; those that are no candidate stay out.
        seed: The training seed that is promoted.
        device: Torch device of those that run here; one that was brought says its own.
        task: Registered name of the task, whose planner may be among the baselines.
        horizons: Of the ladder.

    Raises:
        ConfigError: A method stands on both sides, or the task offers no planner.
        BadInputError: A checkpoint is missing or malformed.
    """
    others = {policy.name for policy in brought}
    own = [name for name in candidates if name not in others]
    learned = [name for name in baselines if name != PLANNER]
    ours = compared(artifacts, baselines=learned, generators=own, seed=seed, device=device)
    everybody: list[Contender] = [
        *ours,
        *(policy for policy in brought if policy.name in candidates),
    ]
    if PLANNER in baselines:
        everybody.insert(list(baselines).index(PLANNER), planned(task, horizons, seed=seed))
    return everybody
