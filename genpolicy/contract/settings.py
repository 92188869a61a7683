"""Settings: frozen, strict sections; what breaks the schema is one `ConfigError` with a place."""

from collections.abc import Mapping, Sequence
from typing import Any, NoReturn, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from genpolicy.errors import ConfigError


class Settings(BaseModel):
    """Base of every settings section: no unknown keys, no coercion, no NaN, no change."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


Section = TypeVar("Section", bound=BaseModel)

RENAMED = {
    "policy.training.steps": "updates",
    "policy.training.warmup_steps": "warmup_updates",
    "train_factors.steps": "updates",
    "execution.replan_lead_steps": "replan_lead_rows",
    "shadow.late_steps": "late_rows",
    "audit.chunk_steps": "chunk_rows",
    "audit.persistence_lag_steps": "persistence_lag_rows",
    "audit.maximum_lag_steps": "maximum_lag_rows",
    "audit.declared_lag_steps": "declared_lag_rows",
    "audit.clock_resolution_steps": "clock_resolution_rows",
    "audit.drift_floor_steps": "drift_floor_rows",
}
"""Keys of `params.yaml` that have another name now, by their place; `steps` are a sampler's, a
training has `updates`, actions are `rows`."""
UNKNOWN = "extra_forbidden"


def parse_settings(model: type[Section], values: Mapping[str, Any], *, where: str) -> Section:
    """The section that `values` (from `params.yaml`) describe.

    Raises:
        ConfigError: An unknown or missing key, a wrong type, a value outside its bounds.
    """
    try:
        return model.model_validate(dict(values))
    except ValidationError as error:
        _refuse(error, where)


def _refuse(error: ValidationError, where: str) -> NoReturn:
    found = error.errors(include_url=False)
    for unknown in (one for one in found if one["type"] == UNKNOWN):
        place = _place(where, unknown["loc"])
        if now := RENAMED.get(place.rpartition(" ")[2]):
            raise ConfigError(
                where=place,
                found=f"an unknown key {unknown['loc'][-1]}; it is called {now} now",
                expected=f"`{now}`",
                action="Rename it; the value stays.",
            ) from error
    first = found[0]
    raise ConfigError(
        where=_place(where, first["loc"]),
        found=repr(first.get("input"))[:120],
        expected=first["msg"],
        action="Correct this setting.",
    ) from error


def _place(where: str, loc: Sequence[int | str]) -> str:
    return ".".join([where, *(str(part) for part in loc)])
