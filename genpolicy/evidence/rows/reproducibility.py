"""Rows of reload and latency: samples, evaluations, coverage, densities and times."""

from dataclasses import dataclass

FIXTURES_ON = "cpu"
"""Where training draws its fixtures, whatever device it trains on."""
THREADS, ALONE, TOGETHER, ORDER = VARIATIONS = ("threads", "alone", "together", "order")
"""Other ways in which fixtures are asked for."""
PARTS = ("encoder", "trunk", "head")
UPDATE = "update"
"""What is counted of a training, beside the parts of the network."""


@dataclass(frozen=True)
class SampleRow:
    """`samples.parquet` of reload: one fixture, drawn before and after reload.

    On the CPU the first draw is that of training. On another device it is that of a process which
    loaded the same files there; of who was brought, that of its first start.

    Attributes:
        method: The candidate.
        seed: Number of its training seed.
        device: Where both were drawn; of who was brought, where its maker says.
        row: Which fixture.
        sha256_trained: Of the samples drawn first; empty where they were none.
        sha256_reloaded: Of those drawn by a fresh process from the files.
        max_abs_difference: Largest difference of an action component, in its own unit.
    """

    method: str
    seed: int
    device: str
    row: int
    sha256_trained: str
    sha256_reloaded: str
    max_abs_difference: float


@dataclass(frozen=True)
class VariationRow:
    """`variations.parquet` of reload: one component of the fixtures, asked for in another way.

    Each way changes one thing. `threads`: a process with two threads in place of one. `alone`: one
    observation and one candidate a call. `together`: twice as many candidates at once. `order`:
    observations in another order. What was drawn plainly, by the same process, stands against it.

    Attributes:
        method: The candidate.
        seed: Number of its training seed.
        device: Where it was drawn; of who was brought, where its maker says.
        variation: What was changed.
        component: Which number of an action.
        chunks: Chunks that were compared; 0 where it could not be asked so.
        unequal: Of them, those that differ in this component.
        max_abs_difference: Largest difference, in the component's own unit; NaN where one is no
            number, None where it could not be asked so.
        unknown: Why it could not be asked so; empty where it was.
    """

    method: str
    seed: int
    device: str
    variation: str
    component: str
    chunks: int
    unequal: int
    max_abs_difference: float | None
    unknown: str


@dataclass(frozen=True)
class ComputeRow:
    """`compute.parquet` of reload: what a part of a network costs, counted where it runs.

    Operations are multiplications and additions of matrix products.

    Attributes:
        method: The candidate.
        seed: Number of its training seed.
        part: `encoder`, `trunk` or `head`, of one row: the first once an invocation, the others
            once a network evaluation. `update`: the loss of one training window and its gradient.
        parameters: Of the part; of `update`, those that exist in training only.
        operations: Of the part.
    """

    method: str
    seed: int
    part: str
    parameters: int
    operations: int


@dataclass(frozen=True)
class NfeRow:
    """`nfe.parquet` of reload: network evaluations of one invocation.

    Attributes:
        method: The candidate.
        seed: Number of its training seed.
        recorded: As written at training.
        counted: As counted at the network after reload.
        expected: By the definition of its sampler, for its steps; where that allows several
            counts, the one nearest to the counted.
        least: The smallest count that the definition allows.
        most: The largest; above the smallest only where a solver chooses its steps by itself.
    """

    method: str
    seed: int
    recorded: int
    counted: int
    expected: int
    least: int
    most: int


@dataclass(frozen=True)
class CoverageRow:
    """`coverage.parquet` of reload: modes against samplers and their steps.

    Attributes:
        method: The candidate.
        seed: Number of its training seed.
        sampler: Name of the sampler.
        steps: Sampler steps.
        sampler_sha256: Settings of the sampler.
        settings: What else is not as by default, in words; empty where nothing is.
        tolerance: Error of a step that it accepts; None of a sampler with equal steps.
        nfe: Network evaluations of one invocation, counted; the most of any situation.
        situations: Held-out situations.
        modes_covered_share: Share of them of which every mode is reached.
        coverage_lower: Lower end of its interval (Clopper-Pearson).
        spread_m: Mean over situations of the samples' spread, m.
        admissible_share: Share of the samples that pass the six layers.
        between_share: Share of the samples in the middle between two modes.
        chunk_error: Mean absolute error on held-out windows, normalised units; NaN where a chunk
            of them is no numbers.
        jerk_p95_m_s3: p95 over the same chunks of the largest jerk inside one, m/s^3; likewise.
        nonfinite: Of the same chunks, those that hold a number that is none, or never came.
        given_up: Of these, those that were given up at the sampler's `nfe_cap`.
    """

    method: str
    seed: int
    sampler: str
    steps: int
    sampler_sha256: str
    settings: str
    tolerance: float | None
    nfe: int
    situations: int
    modes_covered_share: float
    coverage_lower: float
    spread_m: float
    admissible_share: float
    between_share: float
    chunk_error: float
    jerk_p95_m_s3: float
    nonfinite: int
    given_up: int


@dataclass(frozen=True)
class DensityRow:
    """`density.parquet` of reload: one mode of one held-out situation, its density and its share.

    Only of methods that state a density, and of as many situations as the stage has time for.

    Attributes:
        method: The candidate.
        seed: Number of its training seed.
        episode_uuid: The held-out episode.
        index: The row of the situation in it.
        mode: Which mode, in the order of the audit.
        log_density: Of the demonstrated chunk of that mode, nats over normalised actions.
        shape_distance_m: RMS distance of its path from the audit's, once moved onto it, m.
        moved_m: How far it was moved, m.
        samples: Candidates drawn.
        reached: Of them in this mode.
    """

    method: str
    seed: int
    episode_uuid: str
    index: int
    mode: int
    log_density: float
    shape_distance_m: float
    moved_m: float
    samples: int
    reached: int


@dataclass(frozen=True)
class LatencyRow:
    """`latency.parquet`: one term of one invocation.

    Attributes:
        method: The method.
        run: Which of the two measurements, from 1; a declared term belongs to the first.
        process: Which fresh process of its run, from 1.
        component: Term of the latency (`genpolicy.contract.latency.Term`).
        owner: Who answers for the term.
        temperature: `cold` or `warm`.
        repeat: Which invocation of its temperature.
        seconds: Duration, s.
        source: `measured` on this machine, or `declared`.
        waited_s: How much of it the call could have run and had no processor, because other
            processes had them, s; None where the kernel does not say, and of what is declared or
            done behind the wire.
    """

    method: str
    run: int
    process: int
    component: str
    owner: str
    temperature: str
    repeat: int
    seconds: float
    source: str
    waited_s: float | None


@dataclass(frozen=True)
class MachineRow:
    """`machine.parquet` of latency: what ran on the machine while one process was measured.

    Attributes:
        method: The method.
        run: Which of the two measurements, from 1.
        process: Which fresh process of its run, from 1.
        seconds: How long it measured, s.
        cpu_s: Time on a processor of the process itself, s.
        voluntary: How often it gave its processor away: it slept, or waited for something.
        involuntary: How often its processor was taken away.
        others_s: Work of all other processes, on all processors, s; the server of a policy behind
            the wire is among them. None where the kernel does not say.
        stolen_s: Time of all processors that the host of the machine gave to others, s; None
            likewise.
        cpus: Processors.
    """

    method: str
    run: int
    process: int
    seconds: float
    cpu_s: float
    voluntary: int
    involuntary: int
    others_s: float | None
    stolen_s: float | None
    cpus: int


@dataclass(frozen=True)
class LatencyModelRow:
    """`model.parquet`: the model that gate D draws from, against a process that it has not seen.

    Attributes:
        method: The method.
        run: Measurement of the process.
        process: The process; the model was made from all the others.
        level: Which quantile of an invocation's measured terms, summed.
        measured_s: That quantile in the process, s.
        drawn_s: The same of invocations drawn from the model, s.
        measured_running_s: That quantile without the time waited for a processor, s; None where
            nobody knows of one of the terms.
        drawn_running_s: The same of invocations drawn from a model without that time, s; None
            likewise.
    """

    method: str
    run: int
    process: int
    level: float
    measured_s: float
    drawn_s: float
    measured_running_s: float | None
    drawn_running_s: float | None


@dataclass(frozen=True)
class CandidatesRow:
    """`candidates.parquet` of latency: one warm invocation that draws several candidates.

    Attributes:
        method: The method.
        candidates: How many it draws.
        load: What else runs: `none`, or a process on `every core`.
        repeat: Which invocation.
        seconds: From observation to proposal, without the check of it, s.
    """

    method: str
    candidates: int
    load: str
    repeat: int
    seconds: float


@dataclass(frozen=True)
class SweepLatencyRow:
    """`sweep.parquet` of latency: one warm invocation with a sampler of the sweep.

    Attributes:
        method: The candidate.
        sampler_sha256: Settings of the sampler.
        candidates: How many it draws.
        repeat: Which invocation.
        seconds: From observation to proposal, without the check of it, s.
    """

    method: str
    sampler_sha256: str
    candidates: int
    repeat: int
    seconds: float
