"""What only judges, plans or takes in loads no network, simulator or drawing library on the way in.

Each stage and each command is a process of its own, so that what a module imports is paid anew by
every one of them.
"""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
LIGHT = (
    *(f"stages.gate_{letter}" for letter in "abcde"), "stages.card", "stages.candidates",
    "stages.record", "stages.ingest", "gates.planning", "gates.proof", "gates.run_commands",
    "genpolicy.cli.commands",
)  # fmt: skip
HEAVY = ("torch", "matplotlib", "mujoco", "pinocchio", "sklearn", "scipy.stats", "scipy.optimize")
IMPORTED = """
import importlib, sys
said = {}
for name in sys.argv[2].split(","):
    importlib.import_module(name)
    for heavy in sys.argv[1].split(","):
        if heavy in sys.modules:
            said.setdefault(heavy, name)
print(said)
"""


def loaded(names, heavy=HEAVY):
    """Which heavy packages a process has that imports the modules, and behind which of them."""
    words = [sys.executable, "-c", IMPORTED, ",".join(heavy), ",".join(names)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_who_judges_and_plans_loads_no_network_simulator_or_figure():
    assert loaded(LIGHT) == "{}"


def test_what_is_loaded_is_told_with_the_first_who_does():
    assert loaded(("json", "scipy.stats"), ("scipy.stats",)) == "{'scipy.stats': 'scipy.stats'}"
