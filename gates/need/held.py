"""What the simpler policies were measured with, held against audit, plan and checkpoints.

A baseline that was put before the situations that it fails in alone needs a generator; one whose
latent was tested at a handful of them, or with a handful of permutations, shows nothing.
"""

from collections.abc import Sequence

import pandas as pd

from gates.configured import otherwise, unsaid
from gates.criterion import Measured
from gates.evidence import Evidence, MissingEvidenceError
from gates.may_differ import unmatched
from gates.need.settings import MEASURED, TRAINED, NeedSettings
from gates.situations import named_situations, require_every_situation
from genpolicy.evidence.documents.need import LATENT, LatentDependence


def unmatched_baselines(evidence: Evidence, settings: NeedSettings) -> Measured:
    """Settings in which baselines differ, listed or not, and what their list says otherwise.

    Raises:
        MissingEvidenceError: A method is not compared, or has no checkpoint.
    """
    found = unmatched(evidence, TRAINED, settings.baselines, settings.may_differ)
    hidden = [
        f"{name}.{key}: not listed"
        for name in settings.baselines
        for key in unsaid(evidence, TRAINED, name, one_mode=name == settings.one_mode)
    ]
    hidden += [
        f"{name}.{said}"
        for name in settings.baselines
        for said in otherwise(evidence, TRAINED, name, first=settings.seeds[0])
    ]
    if not hidden:
        return found
    listed = [found.caveat] if found.value else []
    return Measured((found.value or 0.0) + len(hidden), caveat="; ".join([*listed, *hidden]))


def require_asked(
    evidence: Evidence, rows: pd.DataFrame, who: str, settings: NeedSettings, *, table: str
) -> None:
    """A baseline was put before every situation by each way of drawing that has rows.

    Raises:
        MissingEvidenceError: As `require_every_situation`.
    """
    for convention, part in rows.groupby("convention"):
        require_every_situation(
            evidence, part, f"{who}, {convention}",
            table=table, samples=settings.samples, seeds=settings.seeds,
        )  # fmt: skip


def require_variant(
    evidence: Evidence, rows: pd.DataFrame, name: str, settings: NeedSettings, *, table: str
) -> None:
    """A variant was put before every situation; one that draws nothing has one sample in each.

    Raises:
        MissingEvidenceError: As `require_every_situation`.
    """
    first = settings.seeds[:1]
    require_every_situation(evidence, rows, name, table=table, samples=1, seeds=first)


def require_latent(
    evidence: Evidence, entries: Sequence[LatentDependence], settings: NeedSettings
) -> None:
    """The latent was tested as planned, once for each training, at every situation.

    Raises:
        MissingEvidenceError: It was not.
    """
    where, method = f"{MEASURED}/{LATENT.file}", settings.latent_baseline
    seeds = [entry.seed for entry in entries]
    if lacking := sorted(set(settings.seeds) - set(seeds)):
        raise MissingEvidenceError(f"{where} has no test of {method} of training seed {lacking[0]}")
    if len(set(seeds)) != len(seeds):
        raise MissingEvidenceError(f"{where} tests a training of {method} twice")
    situations = len(named_situations(evidence))
    for entry in entries:
        if entry.convention != settings.latent_convention:
            raise MissingEvidenceError(
                f"{where} draws {method} by {entry.convention}; planned is "
                f"{settings.latent_convention}"
            )
        if entry.situations != situations:
            raise MissingEvidenceError(
                f"{where} tests {method} at {entry.situations} of the {situations} situations "
                "that the audit names"
            )
        if not entry.permutations >= max(settings.permutations, entry.exceeding):
            raise MissingEvidenceError(
                f"{where} tests {method} with {entry.permutations} permutations, of which "
                f"{entry.exceeding} exceed; planned are {settings.permutations}"
            )
