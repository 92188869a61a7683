"""The policy: physical observations in, physical candidate chunks out, nothing in between stored.

Noise is a pure function of checkpoint, observation, candidate and sampler step, and a network call
has one of few numbers of rows that were measured to give the same bits, so that a row's sample does
not depend on its company.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from genpolicy.contract.horizons import HorizonConfig
from genpolicy.errors import ContractError, IntegrityError
from genpolicy.policies.ahead import Conditions, padded
from genpolicy.policies.call_shapes import call_shapes, compiled_calls
from genpolicy.policies.checkpoint import Checkpoint, load_checkpoint
from genpolicy.policies.determinism import deterministic
from genpolicy.policies.guidance import GUIDED, Guidance, guidance_of
from genpolicy.policies.methods import (
    STOCHASTIC_SAMPLERS,
    check_sampler,
    generate,
    method_named,
    noise_shape,
)
from genpolicy.policies.prefix import Prefix
from genpolicy.policies.protocol import NoiseName, Samples, check_finite
from genpolicy.policies.samplers import refuse_name
from genpolicy.policies.settings import SamplerConfig
from genpolicy.policies.warm_start import WarmStart, skipped_steps, warm_start_of
from genpolicy.seeds import counter_noise

Array = NDArray[np.float64]


class NetworkPolicy:
    """A verified checkpoint with a sampler; see `Policy`.

    The invocation's parts are public, so that each can be timed alone:
    `preprocess`, `encode`, `sample_encoded`; `sample` runs all of them.
    """

    def __init__(
        self, checkpoint: Checkpoint, *, sampler: SamplerConfig | None = None, device: str = "cpu"
    ) -> None:
        config = checkpoint.config
        self.checkpoint = checkpoint
        self.sampler = sampler or config.sampler
        check_sampler(method_named(config.method), self.sampler, config.head)
        self.device = device
        self._normalisation = checkpoint.normalisation
        self._network = checkpoint.network.to(device).requires_grad_(False)
        self._calls = call_shapes(self._network, config, self.sampler, device=device)
        self._compiled = compiled_calls(
            self._network, config, self.sampler, most=self._calls.most, device=device
        )
        self._sampler_hash = self.sampler.hash()

    @property
    def method(self) -> str:
        """Name of the method."""
        return self.checkpoint.config.method

    @property
    def checkpoint_hash(self) -> str:
        """SHA-256 of weights and config."""
        return self.checkpoint.sha256

    @property
    def sampler_config_hash(self) -> str:
        """SHA-256 of the sampler's settings."""
        return self._sampler_hash

    @property
    def horizons(self) -> HorizonConfig:
        """Horizons of the method; K = H_e = 1 for methods without chunks."""
        return self.checkpoint.config.horizons

    @property
    def prediction_horizon(self) -> int:
        """K, actions of one chunk."""
        return self.horizons.prediction_horizon

    @property
    def stochastic(self) -> bool:
        """Whether candidates of one observation differ."""
        return self.sampler.name in STOCHASTIC_SAMPLERS

    @property
    def guided(self) -> bool:
        """Whether its chunks can be drawn to go on, or start, from given actions."""
        return self.sampler.name in GUIDED

    def sample(
        self,
        observations: Array,
        *,
        noise_names: Sequence[NoiseName],
        candidates: int,
        prefix: Prefix | None = None,
    ) -> Samples:
        """Candidate chunks of a batch of observations.

        Args:
            observations: Physical units, newest last. Shape (B, H_o, D_o).
            noise_names: Names of each row's noise; equal names give equal noise. Length B.
            candidates: N >= 1, candidates per row.
            prefix: What each row's chunks are drawn to go on from; None: nothing.

        Returns:
            Actions (B, N, K, D_a) in physical units, and the NFE of one sample (the most of any).

        Raises:
            ConfigError: A prefix for a sampler that has no path from noise to a chunk.
            ContractError: Wrong shape, wrong number of names, no candidate.
            NonFiniteError: An observation is NaN or infinite; a chunk may be, see `Policy.sample`.
            EvaluationCapError: A sample took more network evaluations than its sampler may.
        """
        if len(noise_names) != len(observations) or not candidates >= 1:
            raise ContractError(
                where="a policy invocation",
                found=f"{len(observations)} observations, {len(noise_names)} noise names, "
                f"{candidates} candidates",
                expected="one noise name per observation and at least one candidate",
                action="Name the noise of every row.",
            )
        condition = self.encode(self.preprocess(observations))
        return self.sample_encoded(
            condition, noise_names=noise_names, candidates=candidates, prefix=prefix
        )

    def preprocess(self, observations: Array) -> Tensor:
        """Check and normalise observations (B, H_o, D_o); result on the device.

        Raises:
            ContractError: Wrong shape.
            NonFiniteError: NaN or infinity.
        """
        sizes = self.checkpoint.config.dimensions
        expected = (sizes.observation_horizon, sizes.observation_dim)
        if observations.ndim != 3 or observations.shape[1:] != expected or not len(observations):
            raise ContractError(
                where="observations of a policy invocation",
                found=f"of shape {observations.shape}",
                expected=f"(B, {expected[0]}, {expected[1]}) with B >= 1",
                action="Deliver the last H_o observation vectors.",
            )
        check_finite(observations, "observations of a policy invocation", "Hold.")
        normalised = self._normalisation.observation.normalise(observations)
        return torch.as_tensor(normalised.astype(np.float32)).to(self.device)

    def encode(self, observations: Tensor) -> Tensor:
        """Conditions (B, C) of normalised observations (B, H_o, D_o)."""
        with deterministic(self.device), torch.inference_mode():
            parts = [
                self._network.encode(padded(rows, self._calls.fit(len(rows))))[: len(rows)]
                for rows in torch.split(observations, self._calls.most)
            ]
            return torch.cat(parts)

    def sample_encoded(
        self,
        condition: Tensor,
        *,
        noise_names: Sequence[NoiseName],
        candidates: int,
        prefix: Prefix | None = None,
    ) -> Samples:
        """Candidate chunks of conditions (B, C) from `encode`; see `sample`."""
        if prefix is None or prefix.strength is None:
            return self._drawn(condition, noise_names, candidates, prefix)
        if not self.guided:
            refuse_name(self.sampler.name, GUIDED)
        # Rows with nothing to start from take every step: they are drawn by themselves.
        starts = skipped_steps(prefix.strength, self.sampler.steps) > 0
        known = [starts and bool(own.any()) for own in prefix.weights]
        order, parts = list[int](), list[Samples]()
        for warm in (False, True):
            rows = [row for row, own in enumerate(known) if own == warm]
            if rows:
                names = [noise_names[row] for row in rows]
                given = prefix.of(rows) if warm else None
                parts.append(self._drawn(condition[rows], names, candidates, given))
                order += rows
        actions = np.concatenate([part.actions for part in parts])[np.argsort(order)]
        return Samples(actions, max(part.nfe for part in parts))

    def _drawn(
        self,
        condition: Tensor,
        noise_names: Sequence[NoiseName],
        candidates: int,
        prefix: Prefix | None,
    ) -> Samples:
        """As `sample_encoded`, of rows that all take the same steps."""
        names = [
            (self.checkpoint_hash, *row, candidate)
            for row in noise_names
            for candidate in range(candidates)
        ]
        chunks, evaluations = [], []
        # What is guided is differentiated, which nothing made in inference mode can be.
        plain = prefix is None or prefix.strength is not None
        compiled = self._compiled if plain else None
        calls = compiled.shapes if compiled else self._calls
        with deterministic(self.device), torch.inference_mode(plain), torch.no_grad():
            condition = condition if plain else condition.clone()
            for first in range(0, len(names), calls.most):
                own = names[first : first + calls.most]
                size = calls.fit(len(own))
                # A padding row is the last row again, with its condition.
                rows = [(first + min(row, len(own) - 1)) // candidates for row in range(size)]
                result, nfe = generate(
                    self._network,
                    _conditions(condition, rows),
                    self._noise(own, size),
                    sampler=self.sampler,
                    head=self.checkpoint.config.head,
                    call_rows=self._calls.fit,
                    finish=compiled.finish(size) if compiled else None,
                    guidance=self._goes_on(prefix, rows),
                )
                chunks.append(result[: len(own)].cpu())
                evaluations.append(nfe)
        normalised = torch.cat(chunks).numpy().astype(np.float64)
        actions = self._normalisation.action.denormalise(normalised)
        shape = (len(noise_names), candidates, *actions.shape[1:])
        return Samples(actions.reshape(shape), max(evaluations))

    def _goes_on(self, prefix: Prefix | None, rows: Sequence[int]) -> Guidance | WarmStart | None:
        normalise = self._normalisation.action.normalise
        if prefix is None:
            return None
        if prefix.strength is None:
            return guidance_of(prefix, rows, normalise, device=self.device)
        steps = self.sampler.steps
        return warm_start_of(prefix, rows, normalise, steps=steps, device=self.device)

    def synchronise(self) -> None:
        """Wait until the device has finished what was asked of it."""
        if torch.device(self.device).type == "cuda":
            torch.cuda.synchronize(self.device)

    def _noise(self, names: Sequence[NoiseName], rows: int) -> Callable[[int], Tensor]:
        """Noise function of one padded batch.

        Padding rows repeat the last row, noise as well as condition: an adaptive solver would
        otherwise take the steps, and reach the cap, of samples that nobody asked for.
        """
        shape = noise_shape(
            self.checkpoint.config.dimensions, self.sampler, self.checkpoint.config.head
        )

        def draw(step: int) -> Tensor:
            values = np.zeros((rows, *shape), dtype=np.float32)
            for row, name in enumerate(names):
                values[row] = counter_noise((*name, step), shape=shape)
            values[len(names) :] = values[len(names) - 1]
            return torch.from_numpy(values).to(self.device)

        return draw


def load_policy(
    folder: Path,
    *,
    expected_sha256: str | None = None,
    device: str = "cpu",
    sampler: SamplerConfig | None = None,
    action_contract_sha256: str | None = None,
    observation_contract_sha256: str | None = None,
) -> NetworkPolicy:
    """A policy from a checkpoint folder.

    Args:
        folder: Checkpoint folder.
        expected_sha256: The identity that the checkpoint must have, where the caller knows one.
        device: `cpu` or a CUDA device.
        sampler: Sampler to use instead of the checkpoint's own.
        action_contract_sha256: The action definition in force, where the caller knows it.
        observation_contract_sha256: The observation definition in force, likewise.

    Raises:
        IntegrityError: See `load_checkpoint`; or made for another contract.
        ConfigError: The sampler does not fit the method or its training levels.
    """
    checkpoint = load_checkpoint(folder, expected_sha256=expected_sha256)
    provenance = checkpoint.config.provenance
    for name, found, expected in (
        ("action", provenance.action_contract_sha256, action_contract_sha256),
        ("observation", provenance.observation_contract_sha256, observation_contract_sha256),
    ):
        if expected is not None and found != expected:
            raise IntegrityError(
                where=str(folder),
                found=f"a checkpoint for the {name} contract {found[:16]}…",
                expected=f"{expected[:16]}…",
                action="Train again on a dataset with the contract in force.",
            )
    return NetworkPolicy(checkpoint, sampler=sampler, device=device)


def _conditions(condition: Tensor, observations: Sequence[int]) -> Conditions:
    """The conditions of rows, given by the observation of each; ascending."""
    first, last = observations[0], observations[-1]
    of_row = torch.tensor(observations, device=condition.device) - first
    return Conditions(condition[first : last + 1], of_row)
