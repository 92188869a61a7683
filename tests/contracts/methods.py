"""The lists of `docs/methods.md`: every method and sampler, made from their registry.

`python tests/contracts/methods.py --write` puts them between the page's two marks, and the contract
tests hold them there: what is registered stands on the page, and nothing else does. The keys of a
sampler are asked of the check that refuses settings, and of what `generate` reads.
"""

import sys
from pathlib import Path

import yaml

sys.path.insert(0, str(Path(__file__).parents[2]))

from genpolicy.errors import ConfigError
from genpolicy.policies.diffusion_samplers import DIFFUSION_SAMPLERS
from genpolicy.policies.distillation import GRID_STEPS, MULTISTEP
from genpolicy.policies.evaluations import EVALUATIONS
from genpolicy.policies.guidance import GUIDED
from genpolicy.policies.methods import METHODS, SINGLE_EVALUATION, Method, check_sampler
from genpolicy.policies.ode_samplers import ADAPTIVE_TABLEAUS, CONSISTENCY
from genpolicy.policies.settings import HeadConfig, SamplerConfig

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "methods.md"
BEGIN, END = "<!-- from the registry: begin -->\n", "<!-- from the registry: end -->\n"
READS = {
    "nothing": "nothing", "latent": "a latent", "chunk": "a noisy chunk and a time",
    "codes": "candidate codes, which it scores", "offset": "a draw that moves its chunk",
}  # fmt: skip
CLIPPED = (*DIFFUSION_SAMPLERS, MULTISTEP)
HEAD = HeadConfig()
NEEDS = {
    "direct": "", "z_zero": "the latent is 0", "z_prior": "the latent is drawn",
    "offset": "the draw has the size of the training's residuals",
    "ddpm": "as many steps as levels of the training, or fewer", "ddim": "the same",
    "dpm_1": "the same", "dpm_2m": "the same", "dpm_sde": "the same; fresh noise in every step",
    "euler": "", "midpoint": "", "heun": "", "rk4": "",
    "bosh3": "`nfe_cap`: a sample that reaches it has no chunk",
    "consistency": "`steps` a multiple of `policy.head.flow_segments` "
    f"({HEAD.flow_segments} by default); one step needs `policy.head.flow_segments: 1`",
    "multistep_consistency": f"at most {GRID_STEPS} steps",
    "derivative_free": "`population` of 2 or more", "langevin": "`population` of 2 or more",
}  # fmt: skip
"""What a sampler needs or does, in words; whoever registers one adds a line."""


def section() -> str:
    """What stands between the marks."""
    return "\n".join([*_methods(), "", *_samplers(), ""])


def _methods() -> list[str]:
    lines = [
        "| method | in the default ladder | head reads | samplers, the first by default | needs |",
        "|---|---|---|---|---|",
    ]
    return lines + [
        f"| `{name}` | {_stands(name)} | {READS[method.reads]} "
        f"| {', '.join(f'`{sampler}`' for sampler in method.samplers)} | {_needs(method)} |"
        for name, method in METHODS.items()
    ]


def _stands(name: str) -> str:
    params = yaml.safe_load((ROOT / "params.yaml").read_text())
    for stage, role in (("train_baselines", "baseline"), ("train_generators", "candidate")):
        if name in params[stage]["samplers"]:
            own = SamplerConfig(**params[stage]["samplers"][name])
            return f"{role}: `{own.name}`" + (f", {own.steps} steps" if own.steps > 1 else "")
    return "no"


def _needs(method: Method) -> str:
    needs = []
    if method.weights_of:
        needs.append(f"the weights of `{method.weights_of}`, trained in the same stage")
    if method.teacher:
        needs.append(f"its teacher `{method.teacher}`, trained in the same stage")
    if method.one_mode:
        needs.append("the audit's modes: it is trained on one of them")
    if not method.chunked:
        needs.append("a task for which one action at a time will do: K = H_e = 1")
    return "; ".join(needs)


def _samplers() -> list[str]:
    lines = [
        "| sampler | of | evaluations of a sample with N `steps` | keys beside `name` and "
        "`batch_rows` | can go on from given actions | needs |",
        "|---|---|---|---|---|---|",
    ]
    return lines + [
        f"| `{name}` | {', '.join(f'`{method}`' for method in _of(name))} | {_evaluations(name)} "
        f"| {', '.join(f'`{key}`' for key in keys_of(name))} | {'yes' if name in GUIDED else 'no'} "
        f"| {NEEDS[name]} |"
        for name in EVALUATIONS
    ]


def _of(sampler: str) -> list[str]:
    return [name for name, method in METHODS.items() if sampler in method.samplers]


def _evaluations(name: str) -> str:
    cost = EVALUATIONS[name]
    if name in SINGLE_EVALUATION:
        return f"{cost.per_step}"
    steps = "N" if cost.per_step == 1 else f"{cost.per_step} N"
    once = f" + {cost.once}" if cost.once else ""
    return f"{steps}{once}, N as many as it tries" if cost.growth else f"{steps}{once}"


def keys_of(name: str) -> list[str]:
    """Keys of a sampler's settings that change what it draws, or must be given."""
    method = METHODS[_of(name)[0]]
    tried = {"eta": 0.5, "population": 8}
    found = [] if name in SINGLE_EVALUATION else ["steps"]
    found += ["clip"] if name in CLIPPED else []
    found += [key for key, value in tried.items() if _taken(method, name, key, value)]
    return found + (["tolerance", "nfe_cap"] if name in ADAPTIVE_TABLEAUS else [])


def _taken(method: Method, name: str, key: str, value: float) -> bool:
    """Whether settings with another value than the default pass the check that refuses them."""
    steps = HEAD.flow_segments if name == CONSISTENCY else 1
    cap = 100 if name in ADAPTIVE_TABLEAUS else None
    own = SamplerConfig.model_validate({"name": name, "steps": steps, "nfe_cap": cap, key: value})
    try:
        check_sampler(method, own, HEAD)
    except ConfigError:
        return False
    return True


def written(page: str) -> str:
    """The page with these lists between its marks."""
    before, _, rest = page.partition(BEGIN)
    return f"{before}{BEGIN}{section()}{END}{rest.partition(END)[2]}"


if __name__ == "__main__":
    if sys.argv[1:] != ["--write"]:
        sys.exit("usage: python tests/contracts/methods.py --write")
    PAGE.write_text(written(PAGE.read_text()))
