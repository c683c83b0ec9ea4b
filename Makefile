# make demo    compile the bundled recipe, show the plan, run it
# make test    the test suite          make lint    ruff, mypy --strict, import contracts
# make test-long   tests that take long, up to minutes, beside shorter ones of the same; all random examples
# make test-pr2    tests that are skipped without the PR2, those that take long, too; installs its shape, 430 MB
# make mutants the kernel broken on purpose, and what notices            make coverage   branches that no test takes
# make bench   measurements            make seeds   the bundled recipe in 30 worlds that are not as the map says
# make homes   everyday tasks in homes drawn at random, by four robots, with the table of docs/reference/homes.md: three hours
#              SERIES=acceptance for the homes that follow from the commit; a series that was stopped goes on;
#              ON=tcp://host:8786 on a cluster, whose workers have this checkout
# make faults  how plans end when things go wrong, with the tables of docs/reference/faults.md: in the worlds that follow
#              from the commit, up to four hours; SHARE=0.1 for a tenth of them; a series that was stopped goes on
# make maps    the reachability maps of the bundled robots, after a change of their URDF or of how maps are made
# make processors   the bundled recipe as other processors would run it, ten seeds: the same decisions
# make docs    the documentation as pages in build/docs/VERSION; fails on a link that leads nowhere
# make counts  lines, files, modules of a run, import circles, what exists twice; CHECKOUTS="../main ." side by side
# make fuzz    broken files, then attacks on all commands; FUZZ_SECONDS=1800 FUZZ_CASES=2000 for longer,
#              FUZZ_SEED=7 for other cases
# make bench-locations   how places are found, beside samplers and other inverse kinematics, judged by PyBullet;
#                        PARTS=hard,infeasible for some of it, ROOMS=20 for less; finished parts are kept in .venv
#
# Everything happens in .venv, made on first use by Python 3.11, 3.12 or 3.13: the first that is found, that of uv, too.
# PYTHON=/path/to/python make test   takes another interpreter.

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:

VENV := .venv
BIN := $(VENV)/bin
SEEDS ?= 30
JOBS ?= 2
FUZZ_SECONDS ?= 60
FUZZ_CASES ?= 150
FUZZ_SEED ?= 0
PYTEST_ARGS ?=

# Tests and measurements start hundreds of processes; each would compile all modules anew where the variable is set.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help demo test test-long test-pr2 lint docs docs-links counts bench bench-locations coverage mutants seeds homes faults processors fuzz maps clean

help:
	@sed -n 's/^# //p' Makefile

# The interpreter is looked for only when .venv has to be made; a shim that exists but does not run is passed over.
SUPPORTED := import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))
$(BIN)/python:
	@uv_python() { command -v uv >/dev/null && { uv python find '>=3.11,<3.14' || { uv python install 3.13 && uv python find 3.13; }; }; }; \
	for python in $${PYTHON:-python3.11 python3.12 python3.13 python3 python uv}; do \
	    if test "$$python" = uv; then python=$$(uv_python 2>/dev/null || true); fi; \
	    test -n "$$python" && "$$python" -c '$(SUPPORTED)' 2>/dev/null || continue; \
	    echo "making $(VENV) with $$python ($$("$$python" --version))"; \
	    test "$$(uname -s)" != Linux || test "$$(uname -m)" = x86_64 || \
	        echo "PyBullet has no binary package for Linux on $$(uname -m) and is built from source: this needs a C++ compiler and takes about ten minutes."; \
	    "$$python" -m venv $(VENV) || { echo "that Python cannot make virtual environments; on Debian: apt install python3-venv" >&2; rm -rf $(VENV); exit 1; }; \
	    exit 0; \
	done; \
	echo "planlang needs Python 3.11, 3.12 or 3.13; none found (tried $${PYTHON:-python3.11, python3.12, python3.13, python3, python, uv})" >&2; \
	echo "Newer ones do not work yet, as PyBullet has no binary package for them. PYTHON=/path/to/python names another interpreter." >&2; exit 1

# Stamps: what is installed in .venv follows pyproject.toml, and planlang_command.py, of which pip installs a copy.
# Installing takes minutes: pip lists what it is busy with.
INSTALL = $(BIN)/python -m pip install --disable-pip-version-check --progress-bar off --editable

$(VENV)/.run-stamp: pyproject.toml planlang_command.py | $(BIN)/python
	@echo "installing planlang and what it needs into $(VENV)"
	@$(INSTALL) .
	@touch $@

$(VENV)/.dev-stamp: pyproject.toml planlang_command.py | $(BIN)/python
	@echo "installing planlang and its development tools into $(VENV)"
	@$(INSTALL) '.[dev]'
	@touch $@ $(VENV)/.run-stamp

demo: $(VENV)/.run-stamp
	$(BIN)/planlang compile serve_a_drink --output plan.py --force
	@echo; cat plan.py; echo
	$(BIN)/planlang run plan.py --robot amigo --environment hospital_room --trace run.jsonl --report run.html --picture scene.png \
	    | tee $(VENV)/demo.txt
	@grep -q '^bottle1: held by patient1$$' $(VENV)/demo.txt

# As many processes as cores: threads of theirs would only get in each other's way.
test test-long test-pr2: export OPENBLAS_NUM_THREADS = 1

test: $(VENV)/.dev-stamp
	$(BIN)/python -m pytest --numprocesses auto --dist loadfile $(PYTEST_ARGS)

test-long: $(VENV)/.dev-stamp
	$(BIN)/python -m pytest -m long $(PYTEST_ARGS)
	PLANLANG_EXAMPLES=5000 $(BIN)/python -m pytest -m hypothesis $(PYTEST_ARGS)

test-pr2: $(VENV)/.pr2-stamp
	$(BIN)/python -m pytest -m pr2 --numprocesses $(JOBS) --dist loadfile $(PYTEST_ARGS)

lint: $(VENV)/.dev-stamp
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

$(VENV)/.docs-stamp: $(VENV)/.run-stamp
	@echo "installing what builds the documentation into $(VENV)"
	@$(INSTALL) '.[docs]'
	@touch $@

# A folder for each version, so that pages of earlier ones stay where links lead.
DOCS = build/docs/$(shell $(BIN)/python -c 'import tomllib; print(tomllib.load(open("pyproject.toml", "rb"))["project"]["version"])')
docs: $(VENV)/.docs-stamp
	$(BIN)/sphinx-build -n -W --keep-going -q --builder html docs $(DOCS)
	@echo "open $(DOCS)/index.html"

# Links to other sites; needs a network.
docs-links: $(VENV)/.docs-stamp
	$(BIN)/sphinx-build -n -W --keep-going -q --builder linkcheck docs build/linkcheck

CHECKOUTS ?= .
counts: $(VENV)/.dev-stamp
	@$(BIN)/python tests/counts.py $(CHECKOUTS:%=--checkout %)

$(VENV)/.bench-stamp: $(VENV)/.dev-stamp
	@echo "installing what is measured against into $(VENV)"
	@$(INSTALL) '.[bench]'
	@touch $@

bench: $(VENV)/.bench-stamp
	@set -e; for benchmark in tests/benchmarks/*.py; do \
	    case "$$benchmark" in */seeds.py|*/processors.py|*/doors.py|*/large_maps.py|*/equal_bytes.py|*/cluster.py|*/dead_hand.py|*/second_body.py|*/walks.py|*/why.py) continue;; esac; \
	    echo "== $$benchmark"; $(BIN)/python "$$benchmark"; \
	done
	@echo "== paths of an arm"; $(BIN)/python -m tests.benchmarks.paths
	@echo "== doors and drawers"; $(BIN)/python -m tests.benchmarks.doors
	@echo "== large maps"; $(BIN)/python -m tests.benchmarks.large_maps
	@echo "== faults"; $(BIN)/python -m tests.benchmarks.faults
	@echo "== dead hands"; $(BIN)/python -m tests.benchmarks.dead_hand
	@echo "== another robot in the room"; $(BIN)/python -m tests.benchmarks.second_body

$(VENV)/.pr2-stamp: $(VENV)/.dev-stamp
	@echo "installing the shape of the PR2, 430 MB, into $(VENV)"
	@$(INSTALL) '.[pr2]'
	@touch $@

ROOMS ?= 200
PARTS ?=
bench-locations: $(VENV)/.bench-stamp $(VENV)/.pr2-stamp
	$(BIN)/python -m tests.benchmarks.locations --rooms $(ROOMS) --parts "$(PARTS)" \
	    --keep $(VENV)/bench-locations-$(ROOMS).json

# coverage run, not pytest --cov: our pytest plugin is imported before pytest-cov could look.
# Without tests over random plans: what is covered has to be the same each time.
# Plans that recurse without end come last: Python stops tracing when they overflow.
coverage: $(VENV)/.dev-stamp
	$(BIN)/coverage run -m pytest -p no:cacheprovider -m "not hypothesis" tests/planlang/language \
	    tests/planlang/runs tests/planlang/kernel/test_[c-z]*.py tests/planlang/kernel/test_bad_plans.py
	$(BIN)/coverage report

mutants: $(VENV)/.dev-stamp
	$(BIN)/python tests/mutants/run.py

seeds: $(VENV)/.dev-stamp
	$(BIN)/python tests/benchmarks/seeds.py --seeds $(SEEDS) --jobs $(JOBS)

processors: $(VENV)/.dev-stamp
	$(BIN)/python tests/benchmarks/processors.py

SERIES ?= development
ON ?= local
homes: $(VENV)/.pr2-stamp
	$(BIN)/python -m tests.benchmarks.homes series $(SERIES) --jobs $(JOBS) --on $(ON) --docs docs/reference/homes.md

SHARE ?= 1
faults: $(VENV)/.pr2-stamp
	$(BIN)/python -m tests.benchmarks.faults acceptance --share $(SHARE) --jobs $(JOBS) --docs

fuzz: $(VENV)/.dev-stamp
	$(BIN)/python tests/fuzz/run.py --seconds $(FUZZ_SECONDS) --seed $(FUZZ_SEED) --jobs $(JOBS)
	$(BIN)/python tests/fuzz/run.py --cases $(FUZZ_CASES) --seed $(FUZZ_SEED) --jobs $(JOBS)

maps: $(VENV)/.pr2-stamp
	$(BIN)/python tests/executive/locations/test_bundled_maps.py

clean:
	rm -rf $(VENV) build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
