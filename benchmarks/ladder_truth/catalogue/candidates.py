"""Wrongs in the training of candidates, in their checkpoints, and in their samplers: gate B."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.ladder_truth.outcome import Expected
from benchmarks.ladder_truth.planting import (
    Plant,
    Wrong,
    all_of,
    committed,
    copied,
    document,
    patched,
    silently,
    weights,
)

FLOW = "artifacts/train_generators/flow/seed_0"
DIFFUSION = "artifacts/train_generators/diffusion/seed_0"
STAGE = "stages/train_generators.py"
SAMPLERS = "genpolicy/policies/ode_samplers.py"
B = "B"
REFUSED = r"sha256|identity|checkpoint|config\.json|fixtures|configuration"


def _plan(change: str) -> Plant:
    """Another plan for the candidates than for the baselines."""
    return patched(
        STAGE,
        ("from pathlib import Path", "import dataclasses\nfrom pathlib import Path"),
        ("    reference = ARTIFACTS", f"    {change}\n    reference = ARTIFACTS"),
    )


def _unkeyed(*, of_generators: bool) -> Plant:
    """Fresh noise for the candidates alone, or for all others."""
    among = "in" if of_generators else "not in"
    return patched(
        "genpolicy/policies/policy.py",
        ("values[row] = counter_noise((*name, step), shape=shape)",
         "values[row] = counter_noise((*name, step), shape=shape)\n"
         f"                if self.method {among} ('diffusion', 'flow'):\n"
         "                    values[row] = np.random.default_rng().standard_normal(shape)"),
    )  # fmt: skip


def _settings(what: str) -> Plant:
    return _plan(
        f"plan = dataclasses.replace(plan, settings=plan.settings.model_copy(update={what}))"
    )


def _config(checkpoint: str, change: Callable[[dict[str, Any]], Any]) -> Plant:
    return all_of(document(f"{checkpoint}/config.json", change), committed("train_generators"))


def _weights(checkpoint: str, change: Callable[[dict[str, np.ndarray]], Any]) -> Plant:
    return all_of(weights(checkpoint, change), committed("train_generators"))


def _noisy(tensors: dict[str, np.ndarray]) -> None:
    rng = np.random.default_rng(1)
    for name in sorted(tensors):
        shape = tensors[name].shape
        tensors[name] = (tensors[name] + 0.01 * rng.normal(size=shape)).astype(tensors[name].dtype)


def _not_a_number(tensors: dict[str, np.ndarray]) -> None:
    tensors[min(tensors)].flat[0] = np.nan


def _wider(config: dict[str, Any]) -> None:
    config["normalisation"]["action"]["maximum"][0] *= 1.05


def _no_weights(workspace: Path) -> None:
    (workspace / FLOW / "model.safetensors").unlink()
    committed("train_generators")(workspace)


TRAINING = "plan.settings.training.model_copy(update={})"
WRONGS = (
    Wrong("candidates_trained_longer", "training",
          "Candidates get three times the updates of the baselines that they are held against.",
          "small",
          _settings('{"training": plan.settings.training.model_copy('
                    'update={"updates": 3 * plan.settings.training.updates})}'),
          Expected(B, ("unmatched_keys",))),
    Wrong("candidates_hardly_trained", "training",
          "Candidates get forty updates; their loss still falls.",
          "small",
          _settings('{"training": plan.settings.training.model_copy('
                    'update={"updates": 40, "warmup_updates": 5, "validation_every": 10})}'),
          Expected(B, ("unmatched_keys", "validation_fall_upper", "late_change_upper")),
          note="`late_change_upper` took the place of `validation_fall_upper` since."),
    Wrong("candidates_with_a_larger_head", "training",
          "Candidates have twice the parameters in the head.",
          "small",
          _settings('{"network": plan.settings.network.model_copy('
                    'update={"head_parameters": 2 * plan.settings.network.head_parameters})}'),
          Expected(B, ("unmatched_keys", "parameter_budget_deviation"))),
    Wrong("candidates_learn_the_padding", "training",
          "Padded actions count in the loss of the candidates only.",
          "small",
          _settings('{"training": plan.settings.training.model_copy('
                    'update={"mask_padding": False})}'),
          Expected(B, ("unmatched_keys",))),
    Wrong("bit_in_a_checkpoint", "checkpoint",
          "One bit of a candidate's weights is flipped; size and times stay.",
          "small", silently(f"{FLOW}/model.safetensors"),
          Expected(B, refusal=r"sha256 of artifacts/train_generators/flow")),
    Wrong("checkpoint_of_another_method", "checkpoint",
          "The diffusion checkpoint lies in the folder of the flow.",
          "small", all_of(copied(DIFFUSION, FLOW), committed("train_generators")),
          Expected(B, ("metadata_mismatches", "samples_difference", "unpinned_items"),
                   refusal=REFUSED)),
    Wrong("weights_changed_after_training", "checkpoint",
          "Noise was put on the weights of the flow after training, and the hash renewed.",
          "small", _weights(FLOW, _noisy),
          Expected(B, ("metadata_mismatches", "samples_difference"), refusal=REFUSED)),
    Wrong("weight_is_nan", "checkpoint", "One weight of the flow is NaN, and the hash renewed.",
          "small", _weights(FLOW, _not_a_number),
          Expected(B, ("nonfinite_weights",), refusal=r"finite|NaN|nan")),
    Wrong("normalisation_stretched", "checkpoint",
          "The checkpoint's normalisation of one action is 5 % wider than the dataset's.",
          "small", _config(FLOW, _wider),
          Expected(B, ("metadata_mismatches", "samples_difference", "unpinned_items"),
                   refusal=rf"{REFUSED}|normalisation")),
    Wrong("fewer_sampler_steps", "checkpoint",
          "The checkpoint says four sampler steps where it was trained to be used with sixteen.",
          "small", _config(DIFFUSION, lambda c: c["sampler"].update(steps=4)),
          Expected(B, ("metadata_mismatches", "samples_difference", "nfe_mismatch"),
                   refusal=REFUSED)),
    Wrong("trained_on_another_dataset", "checkpoint",
          "The checkpoint names another dataset than the audited one.",
          "small",
          _config(FLOW, lambda c: c["provenance"].update(dataset_manifest_sha256="0" * 64)),
          Expected(B, ("unpinned_items", "unmatched_keys"), refusal=r"dataset|manifest")),
    Wrong("weights_missing", "checkpoint", "The weights of the flow are gone.",
          "small", _no_weights, Expected(B, ("unpinned_items",), refusal=r"model\.safetensors")),
    Wrong("euler_runs_backwards", "sampler", "The sign of the Euler step is wrong.",
          "small", patched(SAMPLERS, ("x = x + h / tableau.result.divisor",
                                      "x = x - h / tableau.result.divisor")),
          Expected(B, ("outside_modes_upper", "mode_coverage_lower"), candidate="flow")),
    Wrong("noise_without_a_key", "sampler",
          "The sampler's noise is drawn fresh each time, not from its key.",
          "small",
          patched("genpolicy/policies/policy.py",
                  ("values[row] = counter_noise((*name, step), shape=shape)",
                   "values[row] = np.random.default_rng().standard_normal(shape)")),
          Expected(B, ("samples_difference",)),
          note="Baselines draw by the same function, so that gate A is right to stop it; the two "
          "below part it."),
    Wrong("noise_of_the_baselines_without_a_key", "sampler",
          "The noise of the baselines is drawn fresh each time, not from its key.",
          "small", _unkeyed(of_generators=False),
          Expected("A", refusal=r"drawn again under the same key"),
          note="Added when the one above had been stopped at gate A in words about latents."),
    Wrong("noise_of_the_candidates_without_a_key", "sampler",
          "The noise of the candidates is drawn fresh each time, not from its key.",
          "small", _unkeyed(of_generators=True),
          Expected(B, ("samples_difference",)), note="Added with the one above."),
    Wrong("second_evaluation_not_counted", "sampler",
          "The network runs twice per Euler step and is counted by the definition of one.",
          "small",
          patched(SAMPLERS, ("            slopes.append(velocity(point, x.new_full",
                             "            velocity(point, x.new_full(x.shape[:1], time))\n"
                             "            slopes.append(velocity(point, x.new_full")),
          Expected(B, ("nfe_mismatch",), candidate="flow")),
    Wrong("definition_of_nfe_is_wrong", "sampler",
          "What a sampler's definition says of its evaluations is one too many.",
          "small",
          patched("genpolicy/evidence/reproducibility/reload.py",
                  ("expected=allowed.nearest(counted)", "expected=allowed.nearest(counted) + 1"),
                  ("most=allowed.most", "most=allowed.most + 1")),
          Expected(B, ("nfe_mismatch",))),
)  # fmt: skip
