# compass-bench: `make run` and `make test` set up all they need by themselves in .venv.
# PYTHON names another Python (3.11 or newer): make run PYTHON=python3.13

PYTHON ?= python3
PYTEST_ARGS ?=

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --no-input
ROOMS := protocols devices bench dashboards

# Nothing from outside the locked set may leak in.
unexport PYTHONPATH PYTHONHOME PIP_USER PIP_TARGET
export PYTHONNOUSERSITE := 1

.DELETE_ON_ERROR:
.PHONY: run test lint types check vcan good-units benchmark accuracy peers papers lock generated compiled clean FORCE

run: $(VENV)/runtime.ok compiled
	$(BIN)/compass-bench run eol_three_axis --serial SN0001 --out runs

test: $(VENV)/dev.ok compiled
	$(BIN)/python -m pytest $(PYTEST_ARGS)

lint: $(VENV)/dev.ok
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports --no-cache

types: $(VENV)/dev.ok
	$(BIN)/mypy

check: lint types test

vcan: $(VENV)/dev.ok compiled
	.ci/vcan

good-units: $(VENV)/runtime.ok compiled
	$(BIN)/python benchmarks/good_units.py --units 200

benchmark: $(VENV)/dev.ok compiled
	$(BIN)/python benchmarks/ticks.py
	$(BIN)/python benchmarks/dashboard.py
	$(BIN)/python benchmarks/fits.py
	$(BIN)/python benchmarks/estimators.py
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/poses.py
	$(BIN)/python benchmarks/adaptive.py
	$(BIN)/python benchmarks/bridge.py
	$(BIN)/python benchmarks/uncertainty.py

# What the calibration reaches, what it claims, and what the peers reach, all of them in one run.
accuracy: $(VENV)/dev.ok compiled
	$(BIN)/python benchmarks/accuracy.py

# Public packages on the same readings, each in an environment of its own under build/peers/.
peers: $(VENV)/runtime.ok compiled
	$(BIN)/python benchmarks/peers.py

# The page of the reproduced papers.
papers: $(VENV)/runtime.ok compiled
	$(BIN)/compass-bench reproduce --out docs/papers

# The locked sets hold for every Python from 3.11 on; they name hashes and no addresses.
LOCK := $(BIN)/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes \
	--no-annotate --no-header

lock: $(VENV)/dev.ok
	$(LOCK) requirements.in -o requirements.txt
	$(LOCK) requirements-dev.in -o requirements-dev.txt

# The bus's DBC, the axis's EDS and the schemas of the YAML files are made from the code.
generated: $(VENV)/runtime.ok
	$(BIN)/python -m protocols.database
	$(BIN)/python -m bench.procedure_loader

# Own sources are compiled here, because PYTHONDONTWRITEBYTECODE would make each start slow.
compiled: $(VENV)/runtime.ok
	@$(BIN)/python -m compileall -q $(ROOMS)

clean:
	rm -rf $(VENV) build dist .mypy_cache .ruff_cache .pytest_cache .import_linter_cache

# ---- the environment -------------------------------------------------------------------------
# runtime.ok and dev.ok stand only in a complete environment: they are taken away before an
# installation starts. Without runtime.ok, or without a Python that starts, .venv is made anew.

ifneq ($(shell $(BIN)/python -c "import pip, venv; print(1)" 2>/dev/null),1)
$(VENV)/runtime.ok: FORCE
endif

$(VENV)/runtime.ok: requirements.txt pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit("compass-bench needs Python 3.11 or newer; instead found %d.%d: name another with PYTHON=" % sys.version_info[:2] if sys.version_info < (3, 11) else 0)'
	@if ! [ -e $@ ] || ! $(BIN)/python -c "import pip" 2>/dev/null; then \
		rm -rf $(VENV) && echo "making $(VENV)" && $(PYTHON) -m venv $(VENV); fi
	@rm -f $@ $(VENV)/dev.ok
	$(PIP) install --quiet --require-hashes -r requirements.txt
	$(PIP) install --quiet --no-deps --no-build-isolation --editable .
	@touch $@

$(VENV)/dev.ok: $(VENV)/runtime.ok requirements-dev.txt
	@rm -f $@
	$(PIP) install --quiet --require-hashes -r requirements-dev.txt
	@touch $@
