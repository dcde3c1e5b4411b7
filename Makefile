# make demo | test | test-all | test-plain-processor | test-cluster | lint | docs | figures | setup |
# clean.
# Each does the set-up it needs, once.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

.PHONY: demo test test-all test-plain-processor test-cluster lint docs figures setup clean

demo: $(READY)
	$(BIN)/galileo simulate --seed 7 --out demo/clip.mp4
	$(BIN)/galileo fit demo/clip.mp4 --method grad --out demo/grad
	$(BIN)/galileo fit demo/clip.mp4 --method mh --out demo/mh
	@echo "reports: demo/grad/report.html demo/mh/report.html"

# Two processes: one that has compiled all programs of 3,000 tests runs out of memory mappings
# (Linux gives it 65,530) and dies.
PYTEST := $(BIN)/python -m pytest -n 2 --dist loadfile

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
	  tests/commands/test_predict.py tests/inference/test_coverage.py

test-cluster: $(READY)
	@$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev,distributed]'
	$(BIN)/python -m pytest tests/sweeping/test_real_sweeps.py -k ray

lint: $(READY)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/lint-imports
	$(BIN)/pyright

docs: $(READY)
	@$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[docs]'
	$(BIN)/mkdocs build --strict
	@echo "docs: build/site/index.html"

# What README, tutorial and gallery print and draw, made again; prints what differs.
figures: $(READY)
	$(BIN)/python -m tests.docs.figures build/figures

setup: $(READY)

$(READY): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "error: Python 3.11 or newer is needed, $$($(PYTHON) --version) found; try make PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || \
	  { echo "error: $(PYTHON) cannot make a virtual environment; on Debian: apt-get install python3-venv" >&2; exit 1; }
	@echo "Setting up $(VENV): some minutes the first time, about 2 GB"
	@test -x $(BIN)/pip || $(PYTHON) -m venv $(VENV)
	@$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	@touch $@

clean:
	rm -rf $(VENV) demo build dist .pytest_cache .ruff_cache .hypothesis
	find galileo_jax tests benchmarks -name __pycache__ -prune -exec rm -rf {} +
