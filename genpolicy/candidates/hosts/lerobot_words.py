"""What a LeRobot `config.json` says in words: settings that are known, and no name of anything.

LeRobot loads weights, tokenizers and code from where a setting of `config.json` says
(`vlm_model_name`, `vision_encoder_name`, `pretrained_backbone_weights`, ...): a folder of this
machine, or a repository of a hub, of which a copy may lie in a cache. Neither is in the folder, so
that no hash is of it. Which settings do so differs by type and release, but all of them are text.
So text is let through where it is a known word of a known setting, and refused anywhere else.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from genpolicy.candidates.hosts.kinds import CHECKPOINT_FILES, LeRobotEntry
from genpolicy.candidates.hosts.lerobot_shapes import ROWS
from genpolicy.errors import BadInputError, ConfigError
from genpolicy.integrity.documents import read_json

UNREAD = ("device", "repo_id", "license", "tags")
"""Of every policy: where to push it to and how; and its device, which the adapter sets."""
HISTORY = ("pretrained_path", "pretrained_revision")
"""From what a training went on: read by a training, and not by ACT or Diffusion when loaded."""
FEATURE = r"STATE|VISUAL|ENV|ACTION|REWARD|LANGUAGE"
WORDS = {
    "type": r"[a-z][a-z0-9_]*",
    "input_features.*.type": FEATURE,
    "output_features.*.type": FEATURE,
    "normalization_mapping.*": r"MIN_MAX|MEAN_STD|IDENTITY|QUANTILES|QUANTILE10",
    "vision_backbone": r"resnet[0-9]{2,3}",
    "pretrained_backbone_weights": r"ResNet[0-9]{2,3}_Weights\.(DEFAULT|IMAGENET1K_V[12])",
    "feedforward_activation": r"relu|gelu|glu",
    "noise_scheduler_type": r"DDPM|DDIM",
    "beta_schedule": r"linear|scaled_linear|squaredcos_cap_v2|sigmoid",
    "prediction_type": r"epsilon|sample|v_prediction",
    "compile_mode": r"default|reduce-overhead|max-autotune(-no-cudagraphs)?",
    "scheduler_name": r"[a-z_]+",
}
"""By setting, `*` for any one name: all text that LeRobot 0.6.1 writes for ACT and Diffusion.

`pretrained_backbone_weights` begins the training of a camera's backbone by torchvision's own names;
`scheduler_name` is one of diffusers' schedules of the learning rate.
"""


def require_words(entry: LeRobotEntry, folder: Path) -> None:
    """Refuse a config with text that is no known word of a known setting: it may name a place.

    Args:
        entry: What it is.
        folder: Of the entry's file.

    Raises:
        ConfigError: There is such a text; the setting and the text are named.
    """
    path = folder / entry.pretrained_model / CHECKPOINT_FILES[0]
    try:
        config = read_json(path)
    except BadInputError:
        return  # refused by name where files are verified and read
    kind = config.get("type") if isinstance(config, dict) else None
    unread = {*UNREAD, *(HISTORY if kind in ROWS else ())}
    for names, text in _texts(config):
        if names[:1] and names[0] in unread:
            continue
        if not any(_known(names, text, setting, words) for setting, words in WORDS.items()):
            raise ConfigError(
                where=f"{path}: {'.'.join(names)}",
                found=repr(text)[:80],
                expected="null, or a known word of a setting that is known to load nothing "
                f"({', '.join(sorted(name for name in WORDS if '*' not in name))}): what a text "
                "names may be a path or a repository, which no hash in `files` pins",
                action="Save the policy with nothing outside its folder, or serve it by a command "
                "of your own (kind server).",
            )


def _known(names: tuple[str, ...], text: str, setting: str, words: str) -> bool:
    parts = setting.split(".")
    return (
        len(parts) == len(names)
        and all(part in ("*", name) for part, name in zip(parts, names, strict=True))
        and re.fullmatch(words, text) is not None
    )


def _texts(found: Any, names: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], str]]:
    """Every text of a document with the names that lead to it; in a list, those of the list."""
    if isinstance(found, str):
        yield names, found
    elif isinstance(found, dict):
        for name, value in found.items():
            yield from _texts(value, (*names, name))
    elif isinstance(found, list):
        for value in found:
            yield from _texts(value, names)
