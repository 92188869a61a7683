"""The task's planner in the comparison: who it is, and that it was compared where there is one."""

from collections.abc import Mapping
from typing import Any

from gates.protection import is_rehearsal
from gates.rederive_shadow import TaskSection
from gates.stated import section
from genpolicy.candidates.joining import JoiningSettings
from genpolicy.candidates.planned import (
    SAMPLER_SHA256,
    PlannedPolicy,
    planned,
    require_compared,
)
from genpolicy.contract.horizons import HorizonConfig
from genpolicy.evidence.stress.settings import StressSettings
from genpolicy.verification.begun import Maker


def planner_of_ladder(params: Mapping[str, Any]) -> PlannedPolicy:
    """The planner of the ladder's task, as it is installed now.

    Raises:
        ConfigError: The task offers none, or a section of `params.yaml` cannot be read.
    """
    task = section(params, "task", TaskSection).name
    return planned(task, section(params, "horizons", HorizonConfig), seed=0)


def planner_maker(params: Mapping[str, Any], joining: JoiningSettings) -> Maker:
    """What a session of it says it was made by, under a rule of joining.

    Raises:
        ConfigError: As `planner_of_ladder`.
    """
    return planner_of_ladder(params).sha256, joining.sampler_hash(SAMPLER_SHA256)


def rederive_planner(params: Mapping[str, Any]) -> None:
    """Require the planner among the simple methods where the task offers one.

    Raises:
        ConfigError: It was left out in a ladder that is no rehearsal, or is none.
    """
    task = section(params, "task", TaskSection).name
    baselines = section(params, "stress", StressSettings).baselines
    require_compared(task, baselines, rehearsal=is_rehearsal(params))
