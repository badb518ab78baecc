# `make demo` and `make test` do all their own set-up: only Python 3.11+ is needed
# (with a C compiler the detector runs on its compiled kernel, without one on NumPy).
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
# three processes on two cores: an eighth of the time is waited, for terminals and children
PYTEST := $(BIN)/python -m pytest -n 3 --dist worksteal

.PHONY: setup compiled collected demo test lint check wheels figures bench bench-hidden beyond clean

setup: $(STAMP)

$(STAMP): pyproject.toml setup.py $(wildcard dsd_cli/detect/_kernel.c dsd_cli/detect/_goodness.c dsd_cli/effects/_memory.c dsd_cli/signals/_passes.c dsd_cli/signals/_signed.c dsd_cli/files/_csv_text.c)
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install -q --disable-pip-version-check --no-compile -e ".[dev]"
	touch $(STAMP)

# all packages, on all cores: pip would do it on one; some hold files that are for another Python
$(VENV)/.compiled: $(STAMP)
	$(BIN)/python -m compileall -qq -j 0 $(VENV)/lib || true
	touch $(VENV)/.compiled

# a test of a command starts a process, which would compile what it imports where none may keep it
compiled: $(VENV)/.compiled
	$(BIN)/python -m compileall -q dsd_cli bench

# pytest rewrites the assertions of each file of tests: once here, not in each of its processes
collected: compiled
	@PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -qq --collect-only > /dev/null || true  # `make test` says it

demo: compiled
	@mkdir -p out
	@PATH="$(CURDIR)/$(BIN):$$PATH" sh sample_logs/demo.sh

# property tests draw the same examples in every run, so that red means a change; `make bench` draws new ones
test: compiled
	$(PYTEST) -m "not study"

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# quick: the layers and the docs, without all other tests
check: lint
	$(BIN)/python -m pytest tests/architecture tests/docs

# dist: the wheel of this machine, with what its compiler makes; dist/pure: the one that runs anywhere, on NumPy. One
# build makes one wheel (PEP 517), so that `python -m build` alone gives the first, and DSD_PURE=1 the other.
wheels: setup
	$(BIN)/python -m pip install -q --disable-pip-version-check build
	$(BIN)/python -m build --outdir dist
	DSD_PURE=1 $(BIN)/python -m build --wheel --outdir dist/pure

bench: setup
	$(BIN)/python -m pip install -q --disable-pip-version-check -e ".[bench]"
	$(BIN)/python -m bench
	$(PYTEST) -m study
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m bench.beyond cost --print
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m bench hidden --seeds 1
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m bench random

# the study of docs/measured/hidden.md in full: an hour or more
bench-hidden: setup
	$(BIN)/python -m pip install -q --disable-pip-version-check -e ".[bench]"
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m bench hidden --seeds 4
	$(BIN)/python -m bench hidden --page

# docs/figures: what README and docs show, but for the pictures of the studies below; NAMES="compare paper-fig6" draws only these
figures: setup
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m bench.figures $(NAMES)

# the tables and pictures of docs/how/beyond.md; ITEMS="profile coverage" makes only these
beyond: setup
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m bench.beyond $(ITEMS)

clean:
	rm -rf $(VENV) build dist out *.egg-info dsd_cli/detect/_kernel*.so dsd_cli/detect/_goodness*.so dsd_cli/effects/_memory*.so dsd_cli/signals/_passes*.so dsd_cli/signals/_signed*.so dsd_cli/files/_csv_text*.so
