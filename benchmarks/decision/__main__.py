"""`python -m benchmarks.decision`: how often Gate D decides wrongly where the truth is known.

Two parts. The rule of promotion and choice is asked alone in every world (`--trials`). The whole
gate, with all of its criteria over tables in memory, is asked in a few (`--whole`). All other
criteria only take away promotions, so a false promotion of the whole gate is one of the rule too.

Results are one JSON file per world; a run that was killed goes on where it was. What other code,
settings or another world left does not count: a file holds the hash of all it was of. Every trial
has its own named stream, so that a share depends on nothing but the number of trials.
"""

import argparse
import dataclasses
import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from benchmarks.decision import tables
from benchmarks.decision.catalogue import GRADED, MARGIN, WORLDS
from benchmarks.decision.rule import counted, names, told
from benchmarks.decision.whole import judged
from benchmarks.decision.worlds import CONDITIONS, World, draw
from gates.report import stage_of
from gates.settings import Limits, read_limits, read_params, read_settings
from gates.stress.gate import GATE
from gates.stress.rollouts import StressSettings
from gates.stress.weights import DURATION, LEAST_OF_A_SUCCESS
from genpolicy.evidence.stress.power import power_document
from genpolicy.evidence.stress.settings import StressSettings as StressSection
from genpolicy.integrity.documents import canonical_json
from genpolicy.integrity.hashing import sha256_bytes
from genpolicy.seeds import stream

ROOT = Path(__file__).parents[2]
ROOT_SEED = 13
CODE = (
    "benchmarks/decision", "gates/stress", "gates/bounds.py", "gates/engine.py",
    "gates/verdicts.py",
    "genpolicy/evidence/stress/power.py", "genpolicy/seeds.py", "genpolicy/statistics",
)  # fmt: skip
"""What a result is of."""
WHOLE = (
    World("good", "the planned effect, .8 against .5", ("promoted",), (0.5, 0.2), (0.8,)),
    World("better", ".9 against .5", ("promoted",), (0.5, 0.2), (0.9,)),
    World("at_the_margin", ".55 against .5", ("promoted",), (0.5, 0.2), (0.55,)),
    World("no_gain", ".8 against .8", ("promoted",), (0.8, 0.2), (0.8,)),
    World("none_inside", ".9 against .5, and .5 inside the envelope", ("promoted",), (0.5, 0.2),
          (0.9,), tilt=(("envelope", -0.4),)),
    World("graded_cheaper", "as many successes each, of utility .5 and .8", ("promoted",),
          (0.5, 0.2), (0.8,), lost=(0.5, 0.2)),
    World("graded_no_gain", "the same, of .5 and .5", ("promoted",), (0.5, 0.2), (0.5,),
          lost=(0.5, 0.5)),
)  # fmt: skip


def arguments(argv: Sequence[str] | None = None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.decision", description=__doc__)
    parser.add_argument("--trials", type=int, default=10_000, help="of the rule, in each world")
    parser.add_argument("--graded", type=int, default=400, help="of it where outcomes are graded")
    parser.add_argument("--whole", type=int, default=20, help="of the whole gate, in each world")
    parser.add_argument("--only", action="append", default=[], help="name of a world")
    parser.add_argument("--out", type=Path, default=Path("build/decision"))
    parser.add_argument("--docs", type=Path, help="page to print the tables into")
    return parser.parse_args(argv)


def planned(root: Path) -> tuple[StressSettings, Limits, StressSection]:
    """Settings of Gate D as `params.yaml` ships them.

    Raises:
        SystemExit: The worlds are built for another plan.
    """
    params = read_params(root)
    settings = read_settings(params, stage_of("D"), StressSettings)
    limits = read_limits(params, "D", GATE.criteria)
    if settings.margin != MARGIN or set(settings.perturbations) != set(CONDITIONS):
        sys.exit("the worlds are built for another margin, or for other conditions")
    section = StressSection.model_validate(params["stress"])
    return settings.under(limits), limits, section


def of_world(settings: StressSettings, world: World) -> StressSettings:
    """The settings with the methods of a world, each candidate at its share of the alpha."""
    simple = tuple(f"simple_{number}" for number in range(len(world.baselines)))
    weighed = {"model": {DURATION: (1.0 - LEAST_OF_A_SUCCESS, "all that a success may lose")}}
    family = settings.family_alpha * len(world.candidates) / world.registered
    return settings.model_copy(
        update={
            "baselines": simple,
            "candidates": names(world),
            "family_alpha": family,
            "utility": weighed if world.lost else {},
        }
    )


def rule_alone(world: World, settings: StressSettings, trials: int) -> dict[str, Any]:
    """Trials of the rule in one world that are counted."""
    own, began = of_world(settings, world), time.monotonic()
    hits = dict.fromkeys(world.asks, 0)
    for trial in range(trials):
        drawn = draw(world, own.planned_starts, stream(ROOT_SEED, "decision", world.name, trial))
        found = told(drawn, own, world.peeking)
        for asks in world.asks:
            hits[asks] += counted(asks, drawn, found, own.margin, own.candidates)
    seconds = round(time.monotonic() - began, 1)
    return {"name": world.name, "trials": trials, "hits": hits, "seconds": seconds}


def whole_gate(
    world: World, settings: StressSettings, limits: Limits, section: StressSection, trials: int
) -> dict[str, Any]:
    """Verdicts of the whole gate in one world; the rule alone must say the same of the gain."""
    own, began = of_world(settings, world), time.monotonic()
    alpha = replace_alpha(section, own)
    power = dataclasses.asdict(
        power_document(alpha, candidates=len(own.candidates), root_seed=ROOT_SEED)
    )
    verdicts: Counter[str] = Counter()
    unmet: Counter[str] = Counter()
    for trial in range(trials):
        rng = stream(ROOT_SEED, "decision", "whole", world.name, trial)
        drawn = draw(world, own.planned_starts, rng)
        report = judged(drawn, own, limits, power, rng)
        verdicts[report.verdict] += 1
        unmet.update({answer.id for answer in report.criteria if answer.verdict != "PASS"})
        (gain,) = [answer for answer in report.criteria if answer.id == "promotion_e_value"]
        if (gain.verdict,) != told(drawn, own).verdicts:
            raise RuntimeError(f"{world.name}, trial {trial}: the rule alone says something else")
    return {
        "name": world.name, "what": world.what, "trials": trials, "verdicts": dict(verdicts),
        "unmet": dict(unmet), "seconds": round(time.monotonic() - began, 1),
    }  # fmt: skip


def replace_alpha(section: StressSection, settings: StressSettings) -> StressSection:
    """The section with the family's alpha of a world, so that its power table is of this test."""
    return section.model_copy(update={"alpha": settings.family_alpha})


def main(argv: Sequence[str] | None = None) -> int:
    """Run what has no result yet, print the tables. 1 where a share keeps not what was fixed."""
    args = arguments(argv)
    settings, limits, section = planned(Path())
    args.out.mkdir(parents=True, exist_ok=True)
    wanted = [world for world in WORLDS if not args.only or world.name in args.only]
    code = code_of(ROOT)
    results = {
        world.name: kept(args.out / f"rule_{world.name}.json", trials_of(world, args),
                         hash_of(code, world, settings),
                         lambda w=world: rule_alone(w, settings, trials_of(w, args)))
        for world in wanted
    }  # fmt: skip
    gates = [
        kept(args.out / f"whole_{world.name}.json", args.whole,
             hash_of(code, world, settings, limits, section),
             lambda w=world: whole_gate(w, settings, limits, section, args.whole))
        for world in WHOLE if args.whole and (not args.only or world.name in args.only)
    ]  # fmt: skip
    texts = {
        "promotion": tables.promotion(results), "graded": tables.graded(results),
        "whole": tables.whole(gates),
    }  # fmt: skip
    print("\n".join(texts.values()))
    if args.docs:
        page = args.docs.read_text()
        for name, text in texts.items():
            page = tables.into_page(page, name, text)
        args.docs.write_text(page)
    held = (
        tables.kept(world, results[world.name]["hits"][world.asks[0]], trials_of(world, args))
        for world in wanted
    )
    return 1 if any(answer is False for answer in held) else 0


def trials_of(world: World, args: argparse.Namespace) -> int:
    """How many trials of a world are asked for."""
    return args.graded if world in GRADED else args.trials


def code_of(root: Path) -> str:
    """Hash of the code that a result is of, below a checkout: the rule, its test, the worlds."""
    files = sorted(file for place in CODE for file in _python_in(root / place))
    named = [f"{file.relative_to(root)} {sha256_bytes(file.read_bytes())}" for file in files]
    return sha256_bytes("\n".join(named).encode())


def _python_in(place: Path) -> list[Path]:
    return [place] if place.suffix == ".py" else [*place.rglob("*.py")]


def hash_of(code: str, world: World, *asked: BaseModel | Limits) -> str:
    """Hash of a code, a world, and the settings and limits under which it was asked."""
    parts = [
        dataclasses.asdict(part) if isinstance(part, Limits) else part.model_dump(mode="json")
        for part in asked
    ]
    return sha256_bytes(canonical_json([code, dataclasses.asdict(world), *parts]))


def kept(path: Path, trials: int, of: str, run: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """A result that is there, of the same hash and as many trials; else a new one, written at once.

    Args:
        path: Its file.
        trials: How many are wanted.
        of: Hash of all that the result hangs on.
        run: Plays the trials.
    """
    if path.exists():
        found: dict[str, Any] = json.loads(path.read_text())
        if (found["trials"], found.get("of")) == (trials, of):
            return found
    result = {**run(), "of": of}
    print(f"{result['name']:<20} {result['trials']:>6} trials {result['seconds']:>7} s", flush=True)
    path.with_suffix(".tmp").write_text(json.dumps(result, indent=1, sort_keys=True) + "\n")
    path.with_suffix(".tmp").rename(path)
    return result


if __name__ == "__main__":
    sys.exit(main())
