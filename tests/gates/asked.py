"""One measure of a gate, asked of the evidence of a ladder."""

from gates.evidence import Evidence
from gates.proof import SPECS
from gates.settings import read_limits, read_params, read_settings


def settings_of(root, gate):
    """The settings of a gate of this ladder, with its limits."""
    params, spec = read_params(root), SPECS[gate]
    settings = read_settings(params, f"gate_{gate.lower()}", spec.settings)
    return settings.under(read_limits(params, gate, spec.criteria))


def asked(root, criterion, *candidate, gate):
    """What a criterion measures, before any limit."""
    return criterion.measure(Evidence(root), settings_of(root, gate), *candidate)


def found_in(report, name):
    """What a report says of one criterion, of each candidate."""
    return [criterion for criterion in report.criteria if criterion.id == name]


def red(report):
    """Criteria that failed."""
    return {criterion.id for criterion in report.criteria if criterion.verdict == "FAIL"}
