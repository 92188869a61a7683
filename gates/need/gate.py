"""Gate A as a whole: its questions in the order in which a failure is diagnosed; all must hold."""

import re
from collections.abc import Sequence
from pathlib import Path

from gates.cause import CauseLimits, CauseName, limits_of
from gates.criterion import criteria_of
from gates.engine import GateSpec, Judged
from gates.evidence import MissingEvidenceError
from gates.more import hardly_decided
from gates.need import conditioning, kept, modes, semantics, simpler
from gates.need.cause import asked, found_cause
from gates.need.settings import (
    AUDIT,
    MEASURED,
    MEASURED_FACTORS,
    TRAINED,
    TRAINED_FACTORS,
    NeedSettings,
)
from gates.report import Answer, stage_of
from gates.settings import read_limits, read_params, read_settings
from gates.words import NEXT

ONE_MODE = "Gate D asks that in motion, against `one_mode_bc`."
SIMPLER = f"{NEXT}run {{policy}}; nothing in the data has to be mended."
OPEN = (
    f"{NEXT}record more episodes, to know whether {{policy}} is enough; nothing in the data has to "
    "be mended."
)
NEAR = (
    f"{NEXT}try {{policy}}: it is about as good as the limit allows, more recordings will hardly "
    "tell on which side, and nothing in the data has to be mended."
)
NAMED = re.compile(r"; upper bound of (\S+) over ")
"""In the caveat of a criterion that holds one simpler policy to its limit."""
SIMPLER_ASKED = frozenset(
    item.id
    for item in (
        simpler.chunking_valid_share,
        simpler.remedy_valid_share,
        simpler.factor_valid_share,
        kept.baseline_mode_coverage,
    )
)
TRAINED_ASKED = SIMPLER_ASKED | {simpler.latent_dependence_p.id}
"""What is asked of baselines that were trained: nobody is sent to train them."""


def _cause(judged: Judged) -> str:
    """The cause that the audit found, and after a verdict other than PASS what it asks for."""
    try:
        cause = found_cause(judged.evidence, judged.settings)
    except MissingEvidenceError as error:
        return f"Cause unknown: {error}."
    text = f"Cause found by the audit: {cause.text}."
    unmet = {answer.id for answer in judged.answers if answer.verdict != "PASS"}
    if cause.name is CauseName.VALID_MODES and unmet and unmet <= TRAINED_ASKED:
        simple = [a for a in judged.answers if a.id in unmet & SIMPLER_ASKED]
        if not simple:
            return text
        advice = NEAR if any(hardly_decided(answer.caveat) for answer in simple) else OPEN
        if any(answer.verdict == "FAIL" for answer in simple):
            advice = SIMPLER
        return f"{text} {advice.format(policy=_policy(simple))}"
    if judged.verdict != "PASS":
        return f"{text} Next: {cause.next_action}"
    return f"{text} One mode alone may still be enough: {ONE_MODE}"


def _policy(simple: Sequence[Answer]) -> str:
    """The simpler policy that the criteria hold to their limits, by its name where it is one."""
    found = {said[1] for answer in simple if (said := NAMED.search(answer.caveat))}
    if len(simple) == len(found) == 1:
        return f"the simpler policy {found.pop()}"
    return "the simpler policy that the criterion names"


def _beside(judged: Judged) -> tuple[str, ...]:
    """What the cause does not vouch for, also where all holds."""
    try:
        return found_cause(judged.evidence, judged.settings).beside
    except MissingEvidenceError:
        return ()


GATE = GateSpec(
    gate="A",
    settings=NeedSettings,
    criteria=criteria_of(
        vars(semantics), vars(modes), vars(conditioning), vars(simpler), vars(kept)
    ),
    bind=(
        "artifacts/ingest/frames.parquet",
        "artifacts/ingest/episodes.parquet",
        "artifacts/ingest/manifest.json",
        f"{AUDIT}/scene.png",
        f"{AUDIT}/demonstrated.parquet",
        f"{AUDIT}/examples.parquet",
        f"{AUDIT}/alignment.parquet",
        f"{TRAINED}/*/seed_*/model.safetensors",
        f"{TRAINED}/*/seed_*/config.json",
        f"{MEASURED}/offline.parquet",
        f"{TRAINED_FACTORS}/*/seed_*/model.safetensors",
        f"{TRAINED_FACTORS}/*/seed_*/config.json",
        f"{MEASURED_FACTORS}/errors.parquet",
        f"{MEASURED_FACTORS}/effects.parquet",
    ),
    back_to="the dataset, the observation, or the simpler policy",
    go_on="A generator is a candidate: train diffusion and flow under the matched configuration.",
    caveats=(
        f"One mode alone, or the median, stays valid wherever each mode is: {ONE_MODE}",
        "Modes are clusters of recorded chunks; a mode that no demonstrator used is not seen.",
        "Conditional tests see measured variables only; an unrecorded one can still explain modes.",
        "An energy policy (IBC) draws its candidates at random: a generator, reported beside the "
        "deployed baselines and not judged as one.",
        "Factors are separated after a short training with one seed; their intervals cover "
        "held-out episodes, not training, and small effects may be luck.",
    ),
    note=_cause,
    said=_beside,
)


def read_cause_limits(path: Path) -> CauseLimits:
    """Limits of the cause as the `gate_a` section of a file of settings gives them.

    Raises:
        ConfigError: The file, the section or a limit is missing or wrong.
    """
    params = read_params(path.parent, name=path.name)
    settings = read_settings(params, stage_of(GATE.gate), NeedSettings)
    limits = read_limits(params, GATE.gate, GATE.criteria)
    shared, where = asked(limits), f"{path}: gate_a.cause"
    return limits_of(settings.cause, shared, confidence=settings.confidence, where=where)
