"""Which modes does a policy reach? Its samples against the modal chunks of a held-out situation.

A sample is `between` when it lies in the middle of the line from one mode to another, where no
demonstration is, and `far` when it is further from its nearest mode than the modes are apart.
Only samples that are neither cover a mode.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from genpolicy.audit.component_rows import POSITION
from genpolicy.audit.rows import SituationRow
from genpolicy.errors import ContractError
from genpolicy.integrity.rows import read_rows

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

MIDDLE_SHARE = 0.5


@dataclass(frozen=True)
class ModeSituation:
    """A held-out situation with several modes, as the audit wrote it.

    Attributes:
        split: Split of the episode.
        phase: Task phase.
        episode_uuid: The held-out episode.
        index: Its row.
        mean_path: Positions of the mean chunk. Shape (K, P).
        mode_paths: Positions of the modal chunks. Shape (M, K, P).
    """

    split: str
    phase: str
    episode_uuid: str
    index: int
    mean_path: Array
    mode_paths: Array


@dataclass(frozen=True)
class SampleModes:
    """Samples of one policy at one situation.

    Attributes:
        nearest: Nearest mode of each sample. Shape (S,).
        between: In the middle between two modes. Shape (S,).
        far: Further from every mode than the modes are apart. Shape (S,).
        modes_present: Modes of the situation.
        modes_covered: Modes that at least one sample reaches.
    """

    nearest: Integers
    between: NDArray[np.bool_]
    far: NDArray[np.bool_]
    modes_present: int
    modes_covered: int

    def counts(self, among: NDArray[np.bool_]) -> Integers:
        """Samples that reach each mode, of those in `among` (S,). Shape (modes_present,)."""
        reaching = self.nearest[among & ~self.between & ~self.far]
        return np.bincount(reaching, minlength=self.modes_present).astype(np.int64)


def read_situations(
    folder: Path, *, width: int = 3, splits: Sequence[str] = ("validation", "test")
) -> list[ModeSituation]:
    """Persistent situations with several modes from the audit's `neighbourhoods.parquet`.

    Samples are held against routes, so only modes of the position count: where they differ in the
    tool or in time alone, the paths of the modes are one and the same.

    Args:
        folder: The audit's folder.
        width: Components of a position.
        splits: Which splits to take.

    Raises:
        BadInputError: The table is missing or changed.
        IntegrityError: Unknown or missing columns.
    """
    rows = read_rows(folder / "neighbourhoods.parquet", SituationRow)
    return [
        ModeSituation(
            split=row.split,
            phase=row.phase,
            episode_uuid=row.episode_uuid,
            index=row.index,
            mean_path=np.asarray(row.mean_path, dtype=np.float64).reshape(-1, width),
            mode_paths=np.stack(
                [np.asarray(p, dtype=np.float64).reshape(-1, width) for p in row.mode_paths]
            ),
        )
        for row in rows
        if row.two_mode and row.persistent and row.split in splits and row.component == POSITION
    ]


def one_per_episode(situations: Sequence[ModeSituation]) -> list[ModeSituation]:
    """The earliest situation of each held-out episode and phase: independent ones for counting."""
    first: dict[tuple[str, str], ModeSituation] = {}
    for item in sorted(situations, key=lambda s: (s.episode_uuid, s.phase, s.index)):
        first.setdefault((item.episode_uuid, item.phase), item)
    return list(first.values())


def sample_modes(samples: Array, mode_paths: Array, *, position: slice) -> SampleModes:
    """Hold samples against the modes, position by position over the common length.

    Args:
        samples: Sampled chunks, physical units. Shape (S, K_s, D_a); a shorter K_s is compared
            with the beginning of the modes.
        mode_paths: Positions of the modal chunks. Shape (M, K, P), M >= 2.
        position: Where the position lies in the action.

    Raises:
        ContractError: Fewer than two modes, or a position of another size.
    """
    paths = samples[:, :, position]
    if len(mode_paths) < 2 or paths.shape[2] != mode_paths.shape[2]:
        raise ContractError(
            where="samples of a situation",
            found=f"{len(mode_paths)} modes, positions of {paths.shape[2]}",
            expected=f"at least two modes and positions of {mode_paths.shape[2]}",
            action="Use situations with several modes and the dataset's action contract.",
        )
    steps = min(paths.shape[1], mode_paths.shape[1])
    x = paths[:, :steps].reshape(len(paths), -1)
    centres = mode_paths[:, :steps].reshape(len(mode_paths), -1)
    gaps = np.linalg.norm(x[:, None] - centres[None], axis=2)
    nearest = np.argmin(gaps, axis=1)
    between = np.zeros(len(x), dtype=bool)
    reach = np.full(len(x), np.inf)
    for other in range(len(centres)):
        line = centres[other][None] - centres[nearest]
        length = np.linalg.norm(line, axis=1)
        valid = (nearest != other) & (length > 0.0)
        along = np.sum((x - centres[nearest]) * line, axis=1) / np.where(valid, length, 1.0) ** 2
        between |= valid & (along > 0.5 - MIDDLE_SHARE / 2)
        reach = np.where(valid, np.minimum(reach, length), reach)
    far = ~(reach - gaps[np.arange(len(x)), nearest] >= 0)
    reached = np.unique(nearest[~between & ~far])
    return SampleModes(
        nearest=nearest.astype(np.int64),
        between=between,
        far=far,
        modes_present=len(centres),
        modes_covered=len(reached),
    )
