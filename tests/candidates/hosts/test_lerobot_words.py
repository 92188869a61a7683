"""Text in LeRobot's `config.json`: what may name a path or a repository is not served.

The two configs are all that LeRobot 0.6.1 says of ACT and Diffusion by itself, with the settings of
a folder that was pushed to a hub and of a training that went on.
"""

import json

import pytest

from genpolicy.candidates.hosts.forms import require_forms
from genpolicy.candidates.hosts.kinds import read_entry
from genpolicy.candidates.hosts.lerobot_words import require_words
from genpolicy.candidates.hosts.translation import as_server
from genpolicy.errors import ConfigError
from tests.candidates.hosts.test_lerobot_shapes import ACT, ANOTHER, DIFFUSION

PUSHED = {
    "repo_id": "somebody/act", "license": "apache-2.0", "tags": ["robotics", "a/b"],
    "private": None, "push_to_hub": True, "use_amp": False,
}  # fmt: skip
BACKBONE = {
    "vision_backbone": "resnet18", "pretrained_backbone_weights": "ResNet18_Weights.IMAGENET1K_V1",
}  # fmt: skip
WHOLE = {
    "act": {
        **ACT, **PUSHED, **BACKBONE, "feedforward_activation": "relu",
        "normalization_mapping": {"VISUAL": "MEAN_STD", "STATE": "MEAN_STD"},
        "pretrained_path": "/dev/shm/outputs/act", "pretrained_revision": "main",
    },
    "diffusion": {
        **DIFFUSION, **PUSHED, **BACKBONE, "pretrained_backbone_weights": None, "crop_shape": None,
        "normalization_mapping": {"VISUAL": "MEAN_STD", "STATE": "MIN_MAX"},
        "down_dims": [64, 128], "noise_scheduler_type": "DDPM", "prediction_type": "epsilon",
        "beta_schedule": "squaredcos_cap_v2", "compile_mode": "reduce-overhead",
        "scheduler_name": "cosine", "optimizer_betas": [0.95, 0.999], "pretrained_path": None,
    },
    "another": {**ANOTHER, **PUSHED},
}  # fmt: skip


@pytest.fixture
def brought(written):
    """A function that writes a folder with such a config; gives the path of its entry."""

    def write(config):
        path = written("lerobot")
        (path.parent / "act" / "config.json").write_text(json.dumps(config))
        return path

    return write


@pytest.mark.parametrize("config", [*WHOLE.values(), {}, []], ids=lambda config: str(config)[-9:])
def test_what_lerobot_writes_of_its_own_policies_is_let_through(brought, config):
    path = brought(config)
    require_words(read_entry(path), path.parent)


@pytest.mark.parametrize("kind", WHOLE)
@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"pretrained_backbone_weights": "/dev/shm/weights.pth"}, "_weights is '/dev/shm/weights"),
        ({"pretrained_backbone_weights": "../weights.pth"}, r"_weights is '\.\./weights"),
        ({"pretrained_backbone_weights": "ResNet18_Weights.DEFAULT.pth"}, "_weights is 'ResNet18"),
        ({"vision_backbone": "resnet18/../../weights"}, "vision_backbone is 'resnet18/"),
        ({"vision_encoder_name": "openai/clip-vit-base-patch16"}, "encoder_name is 'openai/clip"),
        ({"vlm_model_name": "gpt2"}, "vlm_model_name is 'gpt2'"),
        ({"vlm_model_name": "relu"}, "vlm_model_name is 'relu'"),
        ({"tokenizer": {"name_or_path": "."}}, r"tokenizer.name_or_path is '\.'"),
        ({"adapters": [None, {"path": "~/adapter"}]}, "adapters.path is '~/adapter'"),
        ({"weights": ["here"]}, "weights is 'here'"),
        ({"model": {"repo_id": "somebody/model"}}, "model.repo_id is 'somebody/model'"),
        ({"type": "../act"}, r"type is '\.\./act'"),
    ],
)
def test_text_that_may_name_a_place_is_refused_by_its_setting(brought, kind, changes, told):
    path = brought({**WHOLE[kind], **changes})
    with pytest.raises(
        ConfigError, match=rf"config.json: .*{told}.*expected null.*kind server"
    ) as error:
        require_words(read_entry(path), path.parent)
    assert error.value.exit_code == 2


def test_of_other_types_nobody_knows_whether_they_read_from_what_they_went_on(brought):
    path = brought({**ANOTHER, "pretrained_path": "somebody/base"})
    with pytest.raises(ConfigError, match="pretrained_path is 'somebody/base'"):
        require_words(read_entry(path), path.parent)


def test_it_is_asked_before_anything_trains_and_whenever_its_server_would_start(brought, task):
    """Wrong before: weights of another place were judged under the hash of this folder."""
    path = brought({"vlm_model_name": "/dev/shm/model"})
    entry = read_entry(path).model_copy(update={"interpreter": __file__})
    (path.parent / "act" / "model.safetensors").write_bytes(b"\x02\0\0\0\0\0\0\0{}")
    for ask in (
        lambda: require_forms(entry, path.parent),
        lambda: as_server(entry, path, task.observation),
    ):
        with pytest.raises(ConfigError, match="vlm_model_name"):
            ask()


def test_a_file_that_is_absent_is_refused_where_files_are_verified(written):
    path = written("lerobot")
    (path.parent / "act" / "config.json").unlink()
    require_words(read_entry(path), path.parent)
