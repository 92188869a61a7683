"""The nine symptoms of chapter 6: what to inspect first and next, and what not to conclude."""

from collections.abc import Callable
from dataclasses import dataclass

from gates.diagnosis import of_modes, of_motion, of_seeds, of_time
from gates.diagnosis.looking import Look, Number
from gates.diagnosis.places import PLACES
from gates.diagnosis.reports import Reports
from gates.diagnosis.walk import Walk, walk
from genpolicy.errors import BadInputError

EVERY = "all"


@dataclass(frozen=True)
class Inspection:
    """Where to look.

    Attributes:
        at: In the chapter's words.
        query: What looks there.
        question: What it puts to the evidence.
    """

    at: str
    query: Callable[[Look], None]
    question: str


@dataclass(frozen=True)
class Symptom:
    """One row.

    Attributes:
        name: As it is typed.
        row: What is seen, in the chapter's words.
        first: What to inspect first.
        then: What to inspect next.
        do_not_conclude: What it does not show, however much it looks so.
    """

    name: str
    row: str
    first: Inspection
    then: Inspection
    do_not_conclude: str


@dataclass(frozen=True)
class Asked:
    """An inspection, made.

    Attributes:
        at: Where, in the chapter's words.
        query: The question that was put to the evidence.
        numbers: What was found.
        causes: What speaks.
        undecided: What was asked, and is open.
        unknown: What could not be said, and why.
        waits_for: Gates that are not judged, without which something could not be asked.
    """

    at: str
    query: str
    numbers: tuple[Number, ...]
    causes: tuple[str, ...]
    undecided: tuple[str, ...]
    unknown: tuple[str, ...]
    waits_for: tuple[str, ...]

    @property
    def holds(self) -> bool:
        """Whether something was asked, all of it has an answer, and nothing speaks."""
        open_ones = self.causes or self.undecided or self.unknown or self.waits_for
        shown_open = any(number.verdict not in ("", "PASS") for number in self.numbers)
        return bool(self.numbers) and not open_ones and not shown_open


@dataclass(frozen=True)
class Answered:
    """A symptom, answered for one candidate.

    Attributes:
        symptom: Its name.
        row: What is seen.
        candidate: Whose; empty where no gate has judged one.
        before_all: The first place of the chapter's order that is not in order; empty where none
            is. What is found behind it may be its consequence.
        first: What was inspected first.
        then: What was inspected next.
        look_next: Where to look now.
        do_not_conclude: What it does not show.
    """

    symptom: str
    row: str
    candidate: str
    before_all: str
    first: Asked
    then: Asked
    look_next: str
    do_not_conclude: str

    @property
    def found(self) -> bool:
        """Whether something speaks."""
        return bool(self.first.causes or self.then.causes)

    @property
    def undecided(self) -> bool:
        """Whether something was asked and is open."""
        return bool(self.first.undecided or self.then.undecided)

    @property
    def answerable(self) -> bool:
        """Whether both inspections had a number to look at, and neither waits for a gate."""
        return all(one.numbers and not one.waits_for for one in (self.first, self.then))


SYMPTOMS = (
    Symptom(
        "diverse-unsuccessful", "samples diverse but unsuccessful",
        Inspection("whether modes map to task condition", of_modes.modes_of_condition,
                   "Do the modes answer to the task, or to something that the policy is not told?"),
        Inspection("feasibility and selector leakage", of_modes.feasibility_and_selector,
                   "Are the samples infeasible, or chosen by who knows too much?"),
        "diversity proves multimodal understanding",
    ),
    Symptom(
        "between-modes", "action lies between modes",
        Inspection("alignment and hidden state", of_modes.alignment_and_hidden_state,
                   "Are streams shifted against each other, or is a variable hidden?"),
        Inspection("chunked BC and ACT baseline", of_modes.simpler_policies,
                   "Do chunked BC and ACT act validly where the modes part?"),
        "diffusion needs more steps",
    ),
    Symptom(
        "boundary-jump", "jump at chunk boundary",
        Inspection("H_e, replanning, blending", of_time.chunks_joining,
                   "Is the jump one of the execution horizon, of re-planning or of blending?"),
        Inspection("normalization and queue age", of_time.normalisation_and_queue,
                   "Do normalisations differ, or are the actions in the queue old?"),
        "only architecture is wrong",
    ),
    Symptom(
        "fast-microbenchmark", "flow wins a microbenchmark",
        Inspection("preprocessing, projection, queue accounting", of_time.whole_accounting,
                   "Are preprocessing, projection and queue in the account, or sampling alone?"),
        Inspection("rejection/resample and p95", of_time.rejections_and_p95,
                   "Do rejections, redraws and slow answers take back what sampling gains?"),
        "end-to-end is faster",
    ),
    Symptom(
        "contact-oscillation", "oscillation at contact",
        Inspection("stale action and phase transition", of_motion.stale_and_phase,
                   "Do stale actions, or those of the phase before, act in contact?"),
        Inspection("gains, action rate, projection", of_motion.gains_rate_and_projection,
                   "Do gains, the rate of actions or projection make it swing?"),
        "generator cannot learn contact",
    ),
    Symptom(
        "simulation-only", "simulation passes, hardware fails",
        Inspection("camera, calibration, latency, contact gap", of_motion.simulated_and_declared,
                   "Of camera, calibration, latency and contact, what was only modelled?"),
        Inspection("action age and controller mode", of_motion.age_and_controller_mode,
                   "Are actions too old for a plant, and is the controller's mode asked for?"),
        "only more data are needed",
    ),
    Symptom(
        "seed-variance", "seed variance is large",
        Inspection("sampler seeds and reset bins", of_seeds.noise_and_starts,
                   "Is it the sampler's noise, or are the starts not the same?"),
        Inspection("training seeds and mode coverage", of_seeds.training_and_modes,
                   "Is it the training, or are modes lost in some of them?"),
        "one mean is stable evidence",
    ),
    Symptom(
        "frequent-projection", "projection is frequent",
        Inspection("raw sample distribution", of_modes.raw_samples,
                   "Where do the raw samples lie, before anything repairs them?"),
        Inspection("representation and feasible conditioning", of_modes.feasible_conditioning,
                   "Is one mode outside what the robot can do?"),
        "supervisor is too conservative",
    ),
    Symptom(
        "ood-does-not-stop", "OOD does not stop",
        Inspection("threshold and probe coverage", of_motion.threshold_and_probes,
                   "Was what must stop ever shown to a monitor, and when does it say so?"),
        Inspection("watchdog/fallback wiring", of_motion.stops_wired,
                   "Are watchdog and fallback connected, whatever a monitor says?"),
        "uncertainty owns safety",
    ),
)  # fmt: skip
"""In the chapter's order and words."""


def symptoms_of(name: str) -> tuple[Symptom, ...]:
    """The symptom of a name, or each of them.

    Raises:
        BadInputError: There is no such symptom.
    """
    if name == EVERY:
        return SYMPTOMS
    found = tuple(symptom for symptom in SYMPTOMS if symptom.name == name)
    if not found:
        raise BadInputError(
            where="--symptom",
            found=repr(name),
            expected=", ".join([*(symptom.name for symptom in SYMPTOMS), EVERY]),
            action="Name what you see.",
        )
    return found


def answered(symptom: Symptom, reports: Reports, candidate: str) -> Answered:
    """Make both inspections of a symptom for one candidate."""
    first = _asked(symptom.first, reports, candidate)
    then = _asked(symptom.then, reports, candidate)
    return Answered(
        symptom.name, symptom.row, candidate, _before_all(walk(reports, candidate)), first, then,
        look_next=_look_next(symptom, first, then),
        do_not_conclude=symptom.do_not_conclude,
    )  # fmt: skip


def _asked(inspection: Inspection, reports: Reports, candidate: str) -> Asked:
    look = Look(reports, candidate)
    inspection.query(look)
    return Asked(
        inspection.at, inspection.question, tuple(look.numbers), tuple(look.causes),
        tuple(look.undecided), tuple(look.unknown), tuple(look.waits_for),
    )  # fmt: skip


def _before_all(gone: Walk) -> str:
    ended = gone.ended_at
    if ended is None:
        return ""
    return f"{ended.place} (place {len(gone.stops)} of {len(PLACES)}) is {ended.state}"


def _look_next(symptom: Symptom, first: Asked, then: Asked) -> str:
    if first.causes:
        return f"at what speaks first ({symptom.first.at}), and ask again when it is mended"
    if then.causes:
        return f"at what speaks next ({symptom.then.at}); {_said_of_first(first)}"
    for asked in (first, then):
        if asked.undecided:
            return f"at what is not decided ({asked.at}): what it says may be the cause"
    return _where_nothing_speaks(first, then)


def _where_nothing_speaks(first: Asked, then: Asked) -> str:
    if not (first.numbers or then.numbers):
        return "for what is not known: nothing could be asked"
    if any(number.verdict == "FAIL" for number in (*first.numbers, *then.numbers)):
        return "elsewhere for the cause: the symptom is there, and no cause that was asked speaks"
    shown = {number.verdict for number in (*first.numbers, *then.numbers)} - {"", "PASS"}
    if shown:
        return "for what is not known: a number that is shown is not decided"
    if first.holds and then.holds:
        return "elsewhere: all that the row names was asked, and holds"
    return "for what is not known: what could be asked holds, and the rest is open"


def _said_of_first(first: Asked) -> str:
    """What the first inspection said, where it does not speak."""
    if first.undecided:
        return "what comes first is not decided"
    return "what comes first holds" if first.holds else "what comes first is not known"
