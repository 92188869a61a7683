"""One measure of a gate, asked of the evidence of a ladder."""

from gates.evidence import Evidence
from gates.proof import SPECS
from gates.settings import read_params, read_settings


def settings_of(root, gate):
    """The settings of a gate of this ladder."""
    return read_settings(read_params(root), f"gate_{gate.lower()}", SPECS[gate].settings)


def asked(root, criterion, *candidate, gate):
    """What a criterion measures, before any limit."""
    return criterion.measure(Evidence(root), settings_of(root, gate), *candidate)
