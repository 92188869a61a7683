"""The cause behind the modes: named from the audit's numbers, under the limits of this gate."""

from gates.cause import Cause, default_limits, limits_of, name_cause, read_numbers
from gates.cause.limits import SHARED
from gates.evidence import Evidence, MissingEvidenceError
from gates.need.settings import AUDIT, NeedSettings
from gates.settings import PARAMS_FILE, Limit, Limits, Waiver
from genpolicy.errors import BadInputError

PLACE = f"{PARAMS_FILE}: gate_a.cause"


def found_cause(evidence: Evidence, settings: NeedSettings) -> Cause:
    """The cause that the audit's numbers name under the limits of this gate.

    Raises:
        MissingEvidenceError: Numbers, or limits of shared questions, are missing.
        ConfigError: A limit lies below what the audit looked for, or a question has none.
    """
    shared = asked(settings.limits)
    absent = [question for question in SHARED if question not in shared]
    if absent:
        raise MissingEvidenceError(f"params.yaml: gate_a has no limit of {', '.join(absent)}")
    limits = limits_of(settings.cause, shared, where=PLACE)
    try:
        numbers, draws = read_numbers(
            lambda name: evidence.document(f"{AUDIT}/{name}"),
            lambda name, row: evidence.records(f"{AUDIT}/{name}", row),
        )
    except BadInputError as error:
        raise MissingEvidenceError(str(error)) from error
    return name_cause(numbers, draws, limits)


def asked(limits: Limits) -> dict[str, Limit]:
    """Limits of the gate; a question whose criterion is waived keeps the packaged one.

    A waiver says that a criterion need not be asked here. It cannot say that what the audit did
    measure is in order: where it measured nothing, no limit turns anything red.
    """
    packaged = default_limits()
    kept = {
        name: Limit(packaged[name], f"packaged, since waived: {waiver.reason}", waiver.owner)
        for name, waiver in waived_questions(limits).items()
    }
    return {**kept, **limits.of}


def waived_questions(limits: Limits) -> dict[str, Waiver]:
    """Criteria that are declared not applicable, of those that the cause asks as well."""
    return {name: waiver for name, waiver in limits.waived.items() if name in SHARED}
