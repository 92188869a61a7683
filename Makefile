# Two commands are enough: `make ladder` runs the five gates, `make test` runs the tests.
#
#   make ladder   build the environment once, run the pipeline, print the table of the gates
#   make smoke    the same ladder, reduced (params.smoke.yaml), in its own workspace build/smoke
#   make test     format, lint, types, import contracts, tests
#   make long     the tests that `make test` leaves out because they take minutes each (half an hour)
#   make soak     twenty million random events against executor, stub and supervisor, ten thousand
#                 random chunks at every millisecond (an hour and a half; it goes on where it was cut)
#   make lint     make test without the tests
#   make lerobot  LeRobot's own environment in build/lerobot, to train and serve its policies
#   make doctor   versions against the pins, disk, memory, telemetry, DVC
#   make clean    remove what was generated and is not versioned; the DVC cache stays
#
# Variables: TORCH_INDEX=<url>  another package index for torch (CPU or CUDA builds)
#            PYTHON=<path>      another Python 3.11 (3.12 should do, 3.11 is tested)
#            JOBS=<n>           test processes, default 3: on two cores one works while another waits
#            SEED=<n>           seed of `make soak`, default 0
#            VNU=<path>         vnu.jar (of the npm package vnu-jar): with it and Java `make test` has
#                               the Nu HTML checker read every page; without, those tests are skipped
#
# An end of `make ladder`: 0 the ladder ran to its end, and gate E passes or waits for people;
# otherwise make prints "Error 3" (refused by a gate, the table says which), "Error 2" (bad
# configuration or input) or "Error 1" (a fault of ours). make itself always turns these into its
# own code 2; scripts that need the code call `genpolicy reproduce`.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help

VENV := .venv
BIN := $(CURDIR)/$(VENV)/bin
PYTHON ?= $(shell command -v python3.11 || command -v python3)
JOBS ?= 3
SEED ?= 0
export VNU
PYTHON_LEROBOT ?= $(shell command -v python3.12 || command -v python3.13)
TORCH_PIN := $(shell grep -E '^torch==' constraints.txt)

export DVC_NO_ANALYTICS := 1
export DO_NOT_TRACK := 1
export PREFECT_SERVER_ANALYTICS_ENABLED := false
export PREFECT_HOME := $(CURDIR)/.prefect
export OMP_NUM_THREADS := 1
export PYTHONHASHSEED := 0
# Containers like to switch it on; each of many processes would then compile all sources again.
export PYTHONDONTWRITEBYTECODE :=
# With wider registers torch's sums depend on where a tensor lies in memory (decision 92).
export ATEN_CPU_CAPABILITY := avx2
export MPLBACKEND := Agg
export MPLCONFIGDIR := $(CURDIR)/build/matplotlib
export PATH := $(BIN):$(PATH)

# The stamp holds a hash of what the environment is built from, not a time: a fresh checkout gives
# every file a new time, and an environment that fits must not call pip (nor the network) again.
SHA256 := $(shell command -v sha256sum >/dev/null && echo sha256sum || echo 'shasum -a 256')
WANTED := $(shell cat constraints.txt pyproject.toml | $(SHA256) | cut -d' ' -f1)

.PHONY: help env ladder smoke test long soak lerobot lint doctor clean

help:
	@sed -n '1,24p' Makefile | sed 's/^# \{0,1\}//'

# What is imported is compiled then, which of all that is installed is a small part.
env:
	@if [ "$$(cat $(VENV)/.ok 2>/dev/null)" = "$(WANTED)" ]; then exit 0; fi; \
	if [ ! -x $(BIN)/python ]; then \
	  "$(PYTHON)" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 13))' || { \
	    echo "No Python 3.11 found (looked for python3.11, then python3). Install Python 3.11, or name one: make PYTHON=/path/to/python3.11 $(MAKECMDGOALS)" >&2; \
	    exit 2; }; \
	  "$(PYTHON)" -m venv $(VENV); \
	fi; \
	echo "Building the environment (once, a few minutes) ..."; \
	$(BIN)/python -m pip install --quiet --no-compile -c constraints.txt $(if $(TORCH_INDEX),--extra-index-url $(TORCH_INDEX)) setuptools "$(TORCH_PIN)"; \
	$(BIN)/python -m pip install --quiet --no-compile --no-build-isolation -c constraints.txt -e '.[dev]'; \
	echo "$(WANTED)" > $(VENV)/.ok

ladder: env
	@code=0; python -m genpolicy reproduce || code=$$?; python -m genpolicy gates summary || true; exit $$code

smoke: env
	@python -m genpolicy workspace build/smoke --overrides params.smoke.yaml; \
	code=0; python -m genpolicy reproduce --workspace build/smoke || code=$$?; \
	(cd build/smoke && python -m genpolicy gates summary) || true; \
	echo "This was the smoke ladder, in build/smoke; open build/smoke/reports/index.html"; exit $$code

# Tests write some gigabytes of small files, and wait for each to reach the disk as a ladder does: in
# memory, where there is room for them, nothing waits. TMPDIR says another place.
ROOM := $(shell [ -w /dev/shm ] && df --output=avail -k /dev/shm 2>/dev/null | awk 'NR == 2 && $$1 > 10000000 {print "/dev/shm"}')
WRITTEN_TO := $(or $(TMPDIR),$(ROOM),/tmp)
test long: export TMPDIR := $(WRITTEN_TO)

# Linters and types take one core for a minute or two: beside the tests, and told behind them.
test: env
	@code=0; said=$$(mktemp); $(MAKE) --no-print-directory lint > "$$said" 2>&1 & lint=$$!; \
	trap 'kill $$lint 2> /dev/null || true; rm -f "$$said"' EXIT; \
	python -m pytest -q -n $(JOBS) --dist loadfile --no-loadscope-reorder || code=1; \
	wait $$lint || code=1; cat "$$said"; exit $$code

long: env
	@LONG=1 python -m pytest -q -n $(JOBS) --dist loadfile --no-loadscope-reorder -m long

# LeRobot needs a newer Python and older libraries than ours: it never shares our environment.
lerobot:
	@if ! "$(PYTHON_LEROBOT)" -c 'import sys; sys.exit(not (3, 12) <= sys.version_info < (3, 14))' 2>/dev/null; then \
	  echo "No Python 3.12 or 3.13 found, which LeRobot needs; skipped. Install one, or name it: make PYTHON_LEROBOT=/path/to/python3.12 lerobot"; \
	  exit 0; fi; \
	"$(PYTHON_LEROBOT)" -m venv build/lerobot; \
	build/lerobot/bin/python -m pip install --quiet 'lerobot[dataset,diffusion,async]==0.6.1' accelerate websockets msgpack; \
	echo "LeRobot is in build/lerobot; docs/candidates.md says how to train and to serve with it."

soak: env
	@python -m benchmarks.soak chunks --wanted 10000 --seed $(SEED)
	@python -m benchmarks.soak events --wanted 20000000 --seed $(SEED)

lint: env
	@code=0; ruff check . || code=1; ruff format --check . || code=1; \
	mypy || code=1; lint-imports --no-logo || code=1; exit $$code

doctor: env
	@python -m genpolicy doctor

clean:
	rm -rf build artifacts .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
	find . -path ./$(VENV) -prune -o -name __pycache__ -type d -print0 | xargs -0 rm -rf
