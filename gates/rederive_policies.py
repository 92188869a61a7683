"""What checkpoints do, asked of the checkpoints again: modes, the latent, the fixtures."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gates.rederive_fixtures import rederive_fixtures
from gates.rederive_latent import rederive_latent
from gates.rederive_measured import Bench, rederive_modes
from gates.report import Gate


def rederive_policies(gate: Gate, root: Path, params: Mapping[str, Any]) -> None:
    """Measure again what gates A and B judge of those that were trained here.

    Raises:
        RefusedError: A number is not what its checkpoint gives, or one that is judged lacks.
        ConfigError: A section of `params.yaml` cannot be read.
        IntegrityError: A file is missing, or is not what it claims to be.
        BadInputError: A table cannot be read.
    """
    bench = Bench.of(gate, root, params)
    rederive_modes(bench)
    if gate == "A":
        rederive_latent(bench)
    if gate == "B":
        rederive_fixtures(bench)
