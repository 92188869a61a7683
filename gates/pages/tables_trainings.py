"""Tables of Gate D where several trainings were rolled out: of this checkpoint, and of its method.

Two claims that are easily taken for each other stand one below the other: what the checkpoint that
may be promoted gains, over starts, and what its method gains, over trainings and starts.
"""

from collections.abc import Iterator

from gates.bounds import counted_interval, mean_gain
from gates.evidence import Evidence, MissingEvidenceError
from gates.pages.bound import require_bound
from gates.pages.figures import Folded, Listing, Table
from gates.report import GateReport, parse_section, report_path
from gates.stress.pairs import paired_differences
from gates.stress.rollouts import ROLLED, ROLLOUTS, STRESS, StressSettings
from gates.stress.trainings import Trained, claim_of, over_trainings, path_of
from gates.words import percent, percents, points, span, three
from genpolicy.evidence.documents.stress import TRAININGS
from genpolicy.statistics.eprocess import gain_interval

FILE = f"{STRESS}/{TRAININGS.file}"


def _settings(evidence: Evidence, report: GateReport) -> StressSettings:
    """Settings of the report, whose every table of rollouts is the one that it names."""
    where = f"{report_path(report.gate)}: settings"
    settings = parse_section(StressSettings, report.settings, where=where)
    require_bound(evidence, report, FILE)
    for seed in settings.seeds:
        require_bound(evidence, report, f"{path_of(seed, settings)}/{ROLLED}")
    return settings


def _judged(settings: StressSettings, report: GateReport) -> list[str]:
    return [name for name in settings.candidates if name in report.candidates]


def _of_checkpoint(evidence: Evidence, report: GateReport) -> Table:
    settings = _settings(evidence, report)
    heads = ("candidate", "training seed", "simple method", "gain", "interval over starts",
             "margin")  # fmt: skip
    lines = []
    for name in _judged(settings, report):
        for baseline in settings.baselines:
            found = paired_differences(evidence, settings, name, baseline)
            low, high = gain_interval(found, alpha=settings.alpha)
            lines.append((
                name, str(settings.seeds[0]), baseline, points(mean_gain(found)),
                span(points(low), points(high)), points(settings.margin),
            ))  # fmt: skip
    return (heads, *lines)


def _of_method(evidence: Evidence, report: GateReport) -> Table:
    settings = _settings(evidence, report)
    heads = (
        "candidate", "simple method", "gain", "interval over trainings and starts", "margin",
        "claimed of the method", "gain of each training",
        "trainings above the margin over every simple method", "so of all its trainings",
    )  # fmt: skip
    lines = []
    for name in _judged(settings, report):
        try:
            claim = claim_of(evidence, settings, name)
        except MissingEvidenceError as missing:
            lines.append((name, str(missing), *("",) * (len(heads) - 2)))
            continue
        trainings = len(claim.trained.seeds)
        share = counted_interval(claim.above, trainings, confidence=settings.confidence)
        for gain in claim.gains:
            lines.append((
                name, gain.baseline, points(gain.gain), span(points(gain.low), points(gain.high)),
                points(claim.margin), "yes" if gain.low > claim.margin else "no",
                ", ".join(points(value) for value in gain.of_each),
                f"{claim.above} of {trainings}", percents(*share),
            ))  # fmt: skip
    return (heads, *lines)


def _over_trainings(
    evidence: Evidence, report: GateReport
) -> Iterator[tuple[str, Trained | None, str, StressSettings]]:
    """Every method with several trainings, or why there is none to show."""
    settings = _settings(evidence, report)
    for name in (*_judged(settings, report), *settings.baselines):
        try:
            found = over_trainings(evidence, settings, name)
        except MissingEvidenceError as missing:
            yield name, None, str(missing), settings
        else:
            if len(found.seeds) > 1:
                yield name, found, "", settings


def _spread(evidence: Evidence, report: GateReport) -> Table:
    heads = ("method", "training seeds", "worth of each", "worth", "interval",
             "standard deviation between trainings", "success", "interval")  # fmt: skip
    lines = []
    for name, found, missing, settings in _over_trainings(evidence, report):
        if found is None:
            lines.append((name, missing, *("",) * (len(heads) - 2)))
            continue
        worth, success = (found.mean(settings.confidence, success=of) for of in (False, True))
        lines.append((
            name, ", ".join(map(str, found.seeds)), ", ".join(three(one) for one in found.each),
            three(worth[0]), f"{three(worth[1])} to {three(worth[2])}",
            f"{three(100 * found.scatter)} points", percent(success[0]), percents(*success[1:]),
        ))  # fmt: skip
    return (heads, *lines)


def _components(evidence: Evidence, report: GateReport) -> Table:
    heads = ("method", "training seed", "start", "condition", "noise and the rest")
    lines: list[tuple[str, ...]] = []
    for name, found, missing, _ in _over_trainings(evidence, report):
        if found is None:
            lines.append((name, missing, "", "", ""))
            continue
        parts = found.components
        each = (parts.training, parts.start, parts.condition, parts.rest)
        lines.append((name, *(f"{three(100 * part)} points" for part in each)))
    return (heads, *lines)


LISTINGS = (
    Listing(
        "This checkpoint: what it gains",
        "The checkpoint of the first training seed, named before a rollout, is the one that is "
        "judged and may be promoted. The interval holds the gains that the pairs of starts do not "
        "speak against, whenever one looks, each end at the alpha of one candidate. It says "
        "nothing of another training.",
        FILE,
        _of_checkpoint,
        also=(ROLLOUTS,),
        optional=True,
    ),
    Listing(
        "This method: what its trainings gain",
        "All trainings of a candidate against all of a simple method, from the same starts under "
        "the same conditions. The interval draws trainings and starts anew (Student's t of either, "
        "their widths squared and added, each end at the alpha of one candidate) and takes what "
        "trainings are worth as normal: three trainings cannot show that they are, and where one "
        "training in ten fails outright, the lower end lies too high in a quarter of all trials. "
        "Where all starts end alike, neither end is nearer than so many starts can show. "
        "Behind it, without that assumption: how many trainings gain more than the margin, and "
        "the exact interval of the share of all trainings of the method that would. Nothing here "
        "is judged. Derived again from the journals of every training by genpolicy verify report.",
        FILE,
        _of_method,
        also=(ROLLOUTS,),
        optional=True,
    ),
    Listing(
        "This method: how far its trainings lie apart",
        "What every training of each method is worth, in what is compared, over all planned "
        "conditions; a planner has no training, and of who was brought one is known. The interval "
        "is over trainings and starts, as above, at the confidence of this gate.",
        FILE,
        _spread,
        folded=(
            Folded("Where what a rollout is worth comes from, as standard deviations", _components),
        ),
        also=(ROLLOUTS,),
        optional=True,
    ),
)
