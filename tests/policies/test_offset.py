"""The unlearned offset: its scale is the training residual by phase, its draw one per component."""

import numpy as np
import pytest

from genpolicy.errors import IntegrityError
from genpolicy.policies.checkpoint import WEIGHTS_FILE, load_checkpoint
from genpolicy.policies.normalisation import MinMax, Normalisation
from genpolicy.policies.policy import load_policy
from genpolicy.policies.settings import SamplerConfig
from genpolicy.policies.training import train
from genpolicy.policies.windows import Windows

PHASES = 2


def phased_windows(two_mode_windows, count=512, seed=0):
    """Windows whose observations end with a phase; in the second one everybody does the same."""
    plain = two_mode_windows(count, seed=seed)
    phase = np.arange(count) % PHASES
    named = np.repeat(np.eye(PHASES)[phase][:, None], 2, axis=1)
    actions = plain.actions.copy()
    actions[phase == 1, :, 0] = 0.5
    return Windows(np.concatenate([plain.observations, named], axis=2), actions, plain.is_pad)


def request_with_phases(request_for, windows, method="bc_noise", **changes):
    numbers = {
        name: values.reshape(-1, values.shape[-1])
        for name, values in (("observation", windows.observations), ("action", windows.actions))
    }
    return request_for(
        method,
        normalisation=Normalisation(
            **{part: MinMax(rows.min(0), rows.max(0)) for part, rows in numbers.items()}
        ),
        phase_columns=(3, 4),
        **{"updates": 60, **changes},
    )


@pytest.fixture(scope="module")
def phased(two_mode_windows):
    return phased_windows(two_mode_windows)


@pytest.fixture(scope="module")
def noisy(phased, request_for, tmp_path_factory):
    folder = tmp_path_factory.mktemp("offset")
    source = request_with_phases(
        request_for, phased, "chunked_bc", sampler=SamplerConfig(name="direct")
    )
    train(folder / "chunked_bc" / "seed_0", source, windows=phased)
    train(
        folder / "bc_noise" / "seed_0",
        request_with_phases(request_for, phased),
        windows=phased,
        weights_of=folder / "chunked_bc" / "seed_0",
    )
    return folder


def test_the_weights_are_those_of_the_frozen_policy_and_no_second_training_would_differ(
    noisy, phased, request_for, tmp_path
):
    own = load_checkpoint(noisy / "bc_noise" / "seed_0")
    frozen = load_checkpoint(noisy / "chunked_bc" / "seed_0").network.state_dict()
    for name, value in own.network.state_dict().items():
        assert name == "scale" or value.numpy().tobytes() == frozen[name].numpy().tobytes()
    assert (
        own.config.parameters == load_checkpoint(noisy / "chunked_bc" / "seed_0").config.parameters
    )
    train(tmp_path / "again", request_with_phases(request_for, phased), windows=phased)
    first, again = (
        place / WEIGHTS_FILE for place in (noisy / "bc_noise/seed_0", tmp_path / "again")
    )
    assert first.read_bytes() == again.read_bytes()


def test_golden_scale_is_the_root_mean_square_residual_by_phase_row_and_component(noisy, phased):
    policy = load_policy(noisy / "chunked_bc" / "seed_0")
    predicted = policy.sample(
        phased.observations, noise_names=[("x",)] * len(phased.observations), candidates=1
    ).actions[:, 0]
    scale = policy.checkpoint.normalisation.action
    error = scale.normalise(phased.actions) - scale.normalise(predicted)
    counts = ~phased.is_pad
    found = load_checkpoint(noisy / "bc_noise" / "seed_0").network.scale.numpy()
    assert found.shape == (PHASES, 4, 2)
    for phase in range(PHASES):
        rows = phased.observations[:, -1, 3 + phase] == 1.0
        for k in range(4):
            kept = rows & counts[:, k]
            expected = np.sqrt(np.square(error[kept, k]).mean(axis=0))
            assert found[phase, k] == pytest.approx(expected, rel=1e-4, abs=1e-5)
    # Where sides differ the offset is as large as the sides, elsewhere small.
    assert found[0, :, 0].min() > 3 * found[1, :, 0].max()


def test_an_offset_is_one_draw_per_component_kept_over_the_chunk(noisy, phased):
    checkpoint = load_checkpoint(noisy / "bc_noise" / "seed_0")
    base, moved = (load_policy(noisy / name / "seed_0") for name in ("chunked_bc", "bc_noise"))
    seen = phased.observations[:1]
    plain = base.sample(seen, noise_names=[("x",)], candidates=1).actions[0, 0]
    drawn = moved.sample(seen, noise_names=[("x",)], candidates=1600).actions[0]
    action = checkpoint.normalisation.action
    shift = action.normalise(drawn) - action.normalise(plain)
    z = shift / checkpoint.network.scale.numpy()[0]
    assert np.ptp(z, axis=1).max() < 1e-3
    assert np.abs(z[:, 0].mean(axis=0)).max() < 0.15
    assert z[:, 0].std(axis=0) == pytest.approx([1.0, 1.0], abs=0.1)
    assert abs(np.corrcoef(z[:, 0].T)[0, 1]) < 0.15


def test_the_scale_is_blind_to_held_out_windows(noisy, phased, request_for, tmp_path):
    wild = Windows(phased.observations, phased.actions * 7.0, phased.is_pad)
    train(
        tmp_path / "held_out", request_with_phases(request_for, phased), windows=phased,
        validation=wild, weights_of=noisy / "chunked_bc" / "seed_0",
    )  # fmt: skip
    first = (noisy / "bc_noise" / "seed_0" / WEIGHTS_FILE).read_bytes()
    assert (tmp_path / "held_out" / WEIGHTS_FILE).read_bytes() == first


@pytest.mark.parametrize("changes", [{"updates": 61}, {"seed": 4}])
def test_weights_of_another_training_are_refused(noisy, phased, request_for, tmp_path, changes):
    with pytest.raises(IntegrityError, match="trained with other settings"):
        train(
            tmp_path / "x", request_with_phases(request_for, phased, **changes), windows=phased,
            weights_of=noisy / "chunked_bc" / "seed_0",
        )  # fmt: skip


def test_without_an_observed_phase_there_is_one_scale(folders):
    assert load_checkpoint(folders["bc_noise"]).network.scale.shape == (1, 4, 2)
