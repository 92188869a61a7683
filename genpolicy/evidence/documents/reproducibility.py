"""`identity.json` of reload: what pins a candidate, and what names it to a reviewer."""

from dataclasses import dataclass

from genpolicy.documents.document import Count, Document


@dataclass(frozen=True)
class IdentityCard:
    """What a reviewer must know of a candidate to speak of the same thing (chapter 6, 2.2 and 7).

    Empty text and a count of none are items that nobody recorded.

    Attributes:
        architecture: Encoder, trunk and head with their sizes.
        parameters: Of the network that runs.
        training_seeds: Root seed of each training, as text.
        dataset: Manifest of the dataset, by hash.
        split: Which episodes trained it, by hash.
        action_semantics: Definition of the action, by hash.
        observation_semantics: Definition of the observation, by hash.
        observation_horizon: H_o, observations that condition one invocation.
        prediction_horizon: K, actions of a chunk.
        execution_horizon: H_e, actions executed of it.
        control_rate_hz: Actions per second.
        invocation_rate_hz: Invocations per second where every answer comes in time: the executor
            asks again when `execution.replan_lead_rows` actions of a chunk are left.
        deadline_s: Time after which an answer is given up.
        path: Noise schedule or path between noise and action.
        sampler: Name of the sampler.
        sampler_steps: Its steps.
        eta: Share of the ancestral noise; None of a sampler that has none.
        tolerance: Error of a step; None of a sampler that does not choose its steps.
        evaluations: Network evaluations of a sample, by definition; a range where it adapts.
        precision: Number format of weights and arithmetic.
        device: Where it ran.
        threads: Threads of the arithmetic.
        cpu_capability: Instruction set of the kernels.
        warm_up: Invocations before the first that is timed as warm.
        batch_rows: Rows of a network call, padded.
        candidates: Drawn by one invocation.
        selector: Rule by which one of them is proposed.
        selector_owner: Who answers for the rule.
        selector_sha256: The file that holds the rule, with what the rule reads of the settings.
    """

    architecture: str
    parameters: Count
    training_seeds: list[str]
    dataset: str
    split: str
    action_semantics: str
    observation_semantics: str
    observation_horizon: Count
    prediction_horizon: Count
    execution_horizon: Count
    control_rate_hz: float
    invocation_rate_hz: float
    deadline_s: float
    path: str
    sampler: str
    sampler_steps: Count
    eta: float | None
    tolerance: float | None
    evaluations: str
    precision: str
    device: str
    threads: Count
    cpu_capability: str
    warm_up: Count
    batch_rows: Count
    candidates: Count
    selector: str
    selector_owner: str
    selector_sha256: str


@dataclass(frozen=True)
class CandidateIdentity:
    """What pins a candidate, by hash; the first seed is the one that is promoted.

    Attributes:
        checkpoint: Of the first seed.
        checkpoints: Of every seed.
        config: Configuration file of every seed.
        dataset: Manifest of the dataset that it was trained on.
        normalisation: Statistics of the training split.
        seed: Root seed of each training.
        sampler: Configuration of the sampler.
        metadata_mismatches: Fields that a fresh process read otherwise, over all seeds.
        nonfinite_weights: Weights that are NaN or infinite, over all seeds; of who was brought,
            invocations without a finite chunk.
        nonfinite_chunks: Chunks of its own sampler on held-out windows that hold a number that is
            none, or that never came, over all seeds.
        given_up: Of these, those that were given up at the `nfe_cap` of its sampler.
        card: What names it to a reviewer.
    """

    checkpoint: str
    checkpoints: list[str]
    config: list[str]
    dataset: str
    normalisation: str
    seed: list[int]
    sampler: str
    metadata_mismatches: Count
    nonfinite_weights: Count
    nonfinite_chunks: Count
    given_up: Count
    card: IdentityCard


CANDIDATES = Document("identity.json", dict[str, CandidateIdentity])
"""By method."""
