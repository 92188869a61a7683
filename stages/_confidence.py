"""Coverage of every interval, which measuring stages read as the gates do."""

from pydantic import Field

from genpolicy.contract.settings import Settings, parse_settings
from stages._stage import PARAMS, Params


class SharedConfidence(Settings):
    """Key `confidence`, by which the gates judge as well.

    Attributes:
        confidence: Coverage of every interval.
    """

    confidence: float = Field(gt=0.5, lt=1.0)


def confidence_of(params: Params) -> float:
    """Coverage of every interval.

    Raises:
        ConfigError: Missing, or no such share.
    """
    found = {name: params.raw[name] for name in ("confidence",) if name in params.raw}
    return parse_settings(SharedConfidence, found, where=str(PARAMS)).confidence
