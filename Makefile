# make demo | test | test-all | test-plain-processor | test-shapes | test-cluster | lint | docs | figures | setup |
# clean.
# Each does the set-up it needs, once.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
CORE := $(VENV)/.core
READY := $(VENV)/.ready

# uv where it is installed: the same versions, sooner. make UV= takes pip all the same (whose settings,
# such as a mirror, uv does not read). Neither writes the 250 MB of bytecode: Python writes what it
# comes to need, also where the environment (of many containers) tells it not to.
UV ?= uv
UV_INSTALL := $(UV) pip install --python $(BIN)/python
PIP_INSTALL := $(BIN)/pip install --disable-pip-version-check --no-compile
HAS_UV := $(and $(UV),$(shell $(UV) --version 2>/dev/null))
INSTALL := $(if $(HAS_UV),$(UV_INSTALL),$(PIP_INSTALL)) --quiet -c constraints.txt
export PYTHONDONTWRITEBYTECODE :=

.PHONY: demo test test-all test-plain-processor test-shapes test-cluster lint docs figures setup clean

demo: $(CORE)
	$(BIN)/galileo simulate --seed 7 --out demo/clip.mp4
	$(BIN)/galileo fit demo/clip.mp4 --method grad --out demo/grad
	$(BIN)/galileo fit demo/clip.mp4 --method mh --out demo/mh
	@echo "reports: demo/grad/report.html demo/mh/report.html"

# Two processes: one that has compiled all programs of 3,000 tests runs out of memory mappings
# (Linux gives it 65,530) and dies.
PYTEST := $(BIN)/python -m pytest -n 2 --dist loadfile --durations=20

test: $(READY)
	$(PYTEST) -m "not slow"

test-all: $(READY)
	$(PYTEST)

# As a processor without AVX computes it: other roundings must not show.
PLAIN := XLA_FLAGS=--xla_cpu_max_isa=SSE4_2 OPENBLAS_CORETYPE=Nehalem \
  XDG_CACHE_HOME=$(CURDIR)/build/plain_processor

test-plain-processor: $(READY)
	$(PLAIN) $(PYTEST) tests/docs
	$(PYTEST) tests/api/test_processors.py
	$(PLAIN) $(PYTEST) -m "not slow" tests/commands/test_fit.py tests/commands/test_compare.py \
	  tests/commands/test_predict.py tests/inference/test_coverage.py \
	  tests/neural/test_estimate.py tests/measurement/test_check_frame_rate.py

# What annotations say of shapes and types, at every call; of the rooms that are all numbers.
NUMERICS := model rollout similarity statespace
comma := ,
empty :=
space := $(empty) $(empty)
CHECKED := $(subst $(space),$(comma),$(addprefix galileo_jax.,$(NUMERICS)))

test-shapes: $(READY)
	$(PYTEST) -m "not slow" --jaxtyping-packages=$(CHECKED),beartype.beartype $(addprefix tests/,$(NUMERICS))

test-cluster: $(READY)
	@$(INSTALL) -e '.[dev,distributed]'
	$(BIN)/python -m pytest tests/sweeping/test_real_sweeps.py -k ray

lint: $(READY)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/lint-imports
	$(BIN)/pyright

docs: $(READY)
	@$(INSTALL) -e '.[docs]'
	$(BIN)/mkdocs build --strict
	@echo "docs: build/site/index.html"

# What README, tutorial and gallery print and draw, made again; prints what differs.
figures: $(READY)
	$(BIN)/python -m tests.docs.figures build/figures

setup: $(READY)

# What `galileo` needs to run; enough for the demo.
$(CORE): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "error: Python 3.11 or newer is needed, $$($(PYTHON) --version) found; try make PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || \
	  { echo "error: $(PYTHON) cannot make a virtual environment; on Debian: apt-get install python3-venv" >&2; exit 1; }
	@echo "Setting up $(VENV): about a minute the first time, 1.3 GB"
	@test -x $(BIN)/pip || $(PYTHON) -m venv $(VENV)
	@$(INSTALL) -e .
	@touch $@

# What tests and checks need beside it: node, a driver of browsers, notebooks, the studio.
$(READY): $(CORE)
	@echo "Adding to $(VENV) what tests and checks need: 0.8 GB"
	@$(INSTALL) -e '.[dev]'
	@touch $@

clean:
	rm -rf $(VENV) demo build dist .pytest_cache .ruff_cache .hypothesis
	find galileo_jax tests benchmarks -name __pycache__ -prune -exec rm -rf {} +
