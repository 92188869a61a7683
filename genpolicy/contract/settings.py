"""Settings: frozen, strict sections; what breaks the schema is one `ConfigError` with a place."""

from collections.abc import Mapping
from typing import Any, NoReturn, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from genpolicy.errors import ConfigError


class Settings(BaseModel):
    """Base of every settings section: no unknown keys, no coercion, no NaN, no change."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


Section = TypeVar("Section", bound=BaseModel)


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
    first = error.errors(include_url=False)[0]
    place = ".".join([where, *(str(part) for part in first["loc"])])
    raise ConfigError(
        where=place,
        found=repr(first.get("input"))[:120],
        expected=first["msg"],
        action="Correct this setting.",
    ) from error
