"""What may differ between methods that are compared: a list in `params.yaml`, with a reason each.

Training writes down every setting in which a method differs from the reference and judges none of
them (`matched.json`). Gates A and B hold that against one list; what differs and is not on it is a
comparison with other settings. What a gain would be a gain of, if it differed, is never on the
list, whatever reason is given.

Two things are not caught here. The training leaves out of `matched.json` what a method is by
definition (`genpolicy.policies.matched_training`): `horizons` and `dimensions.prediction_horizon`
of who predicts one action, `provenance.episodes_sha256` of who learns one mode. And the rest of
`training`, as a learning rate, may differ between methods where somebody writes down why.
"""

from collections.abc import Mapping, Sequence
from typing import Annotated

from pydantic import AfterValidator, Field

from gates.criterion import Measured
from gates.evidence import Evidence, MissingEvidenceError
from gates.report import StrictModel, parse_section
from genpolicy.evidence.documents.given import MATCHED

PLACE = "comparison.may_differ"
"""The list in `params.yaml`, of gates A and B alike."""
DATA = "other data, another split or another action is another task"
ANOTHER = "a chunk of another length, rate or history answers another question"
LONGER = "who has seen more windows gains by it"
NEVER: Mapping[str, str] = {
    "format_version": "two forms of a checkpoint do not say the same",
    "provenance": DATA,
    "normalisation": DATA,
    "horizons": ANOTHER,
    "dimensions": ANOTHER,
    "training.updates": LONGER,
    "training.batch_size": LONGER,
    "training.mask_padding": DATA,
    "training_seed": "a seed that one method may choose is a selection",
}
"""Settings that may never differ, themselves or what stands below them, and why."""


def _possible(listed: tuple[tuple[str, str], ...]) -> tuple[tuple[str, str], ...]:
    keys = [key for key, _ in listed]
    if twice := sorted({key for key in keys if keys.count(key) > 1}):
        raise ValueError(f"{', '.join(twice)} is listed twice; one reason each")
    for key in keys:
        for never, reason in NEVER.items():
            if f"{key}.".startswith(f"{never}."):
                raise ValueError(f"{key} may never differ: {reason}")
    return listed


Listed = Annotated[
    tuple[
        tuple[Annotated[str, Field(pattern=r"^\S+$")], Annotated[str, Field(pattern=r"\S")]], ...
    ],
    AfterValidator(_possible),
]
"""Settings that may differ, each with its reason."""


class ComparisonSection(StrictModel):
    """The shared section `comparison`.

    Attributes:
        may_differ: Settings that may differ between methods, each with its reason.
    """

    may_differ: Listed


def require_possible(section: object) -> None:
    """Refuse a comparison that may never be, before anything trains for it.

    Args:
        section: `comparison` of `params.yaml`.

    Raises:
        ConfigError: It breaks the model, or lists what may never differ.
    """
    parse_section(ComparisonSection, section, where="params.yaml: comparison")


def unmatched(
    evidence: Evidence, folder: str, methods: Sequence[str], may_differ: Sequence[tuple[str, str]]
) -> Measured:
    """Settings in which methods differ from the reference although the list does not allow it.

    Args:
        evidence: The evidence.
        folder: Of the stage that trained them.
        methods: The methods.
        may_differ: Settings that may differ, each with its reason.

    Returns:
        How many, of all methods; where there is none, what differs and why it may.

    Raises:
        MissingEvidenceError: A method is not compared.
    """
    differing, reasons = evidence.document(folder, MATCHED).differing_keys, dict(may_differ)
    found: dict[str, list[str]] = {}
    for method in methods:
        if method not in differing:
            raise MissingEvidenceError(f"{folder}/{MATCHED.file} does not compare {method}")
        found[method] = differing[method]
    bad = [f"{name}.{key}" for name, keys in found.items() for key in keys if key not in reasons]
    if bad:
        return Measured(float(len(bad)), caveat="; ".join(bad))
    allowed = [key for key in reasons if any(key in keys for keys in found.values())]
    told = "; ".join(f"{key} ({reasons[key]})" for key in allowed)
    return Measured(0.0, caveat=f"differs where it may: {told}" if told else "nothing differs")
