"""A device that is named elsewhere than in `params.yaml`: on the command line, in an entry."""

from genpolicy.errors import ConfigError
from genpolicy.policies.determinism import require_device


def require_here(device: str, *, where: str) -> None:
    """Refuse a device that this machine does not have, and say who named it.

    Args:
        device: Torch device.
        where: Where it is named.

    Raises:
        ConfigError: No such device, or none of this kind.
    """
    try:
        require_device(device)
    except ConfigError as error:
        raise ConfigError(
            where=where,
            found=error.found,
            expected=error.expected,
            action="Name one of these, or run where the device is.",
        ) from error
