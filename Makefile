# `make help` lists what can be done. Needs Python 3.11 or newer, git and make; everything else goes into .venv.
PYTHON ?= python3
CONSTRAINTS ?= constraints.txt
VENV := .venv
SHELL := /bin/bash
export PATH := $(CURDIR)/$(VENV)/bin:$(PATH)
unexport PYTHONPATH VIRTUAL_ENV
# A git hook sets them; copies of the project have repositories of their own.
unexport GIT_DIR GIT_WORK_TREE GIT_INDEX_FILE GIT_COMMON_DIR GIT_OBJECT_DIRECTORY
# `setup` imports what the pipeline does, which compiles it; else each of some hundred processes would compile torch again.
unexport PYTHONDONTWRITEBYTECODE
# Threads that wait for work sleep; results do not depend on it.
export OMP_WAIT_POLICY := PASSIVE

TOO_OLD = "$(VENV) has Python %d.%d, and 3.11 or newer is needed: rm -r $(VENV); make setup PYTHON=python3.12"

.DEFAULT_GOAL := help
REV ?= HEAD
.PHONY: gone help setup params tune reproduce studies compare judge release smoke test test-all mutants rosenv ros pythons trust docs readme dist audit check

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-10s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup: $(VENV)/.installed ## create .venv and install everything (once, and again when dependencies change)
	@.ci/history

$(VENV)/.installed: pyproject.toml $(CONSTRAINTS) $(shell test -x $(VENV)/bin/python || echo gone)
	@$(VENV)/bin/python -c 'import pip' 2> /dev/null || $(PYTHON) -m venv $$(test -x $(VENV)/bin/python || echo --clear) $(VENV)
	@$(VENV)/bin/python -c 'import sys; sys.exit($(TOO_OLD) % sys.version_info[:2] if sys.version_info < (3, 11) else 0)'
	$(VENV)/bin/python -m pip install --quiet --no-compile --constraint $(CONSTRAINTS) --editable '.[train,dev,docs]'
	$(VENV)/bin/python -c 'import dvc.cli, stages.config'
	@touch $@

params: setup ## write params.yaml from conf/
	python -m pedpred.config

tune: setup ## fit trackers and social forces to real places again (writes conf/, about ten minutes)
	dvc repro ingest
	places=$$(python -m tools.places tuned_on) && for place in $$places; do python -m tools.tune_tracker $$place || exit; done
	python -m pedpred.config
	dvc repro rows@lstm-real
	places=$$(python -m tools.places fitted_on) && for place in $$places; do python -m tools.fit_social_force $$place || exit; done
	python -m pedpred.config

reproduce: setup ## run what is out of date: raw data, networks, reports/ and the tables of the pages
	@python -m tools.mend_lock
	@python -m pedpred.config --check
	@python -m tools.recordings
	@if compgen -G 'data/raw/*/UNAVAILABLE.txt' > /dev/null; then exec .ci/incomplete; fi; \
	failed=0; dvc repro --keep-going || failed=1; \
	python -m tools.readme || failed=1; exit $$failed

studies: setup ## run what is out of date of the other studies, too: ETH and UCY as the field compares, drives
	dvc repro --keep-going --all-pipelines && python -m tools.readme

compare: setup ## list metrics that left their intervals since REV=<revision>; fails if some got worse
	@python -m tools.compare $(REV)

judge: setup ## measure models/online/default: errors, exact properties, speed; fails if a promise is broken or the model of REV is better
	python -m tools.judge --against $(REV)

release: setup ## make models/online/large the default model, unless it is worse or breaks more promises; ACCEPT="hotel" lets that get worse
	python -m tools.judge models/online/large --replace models/online/default $(if $(ACCEPT),--accept "$(ACCEPT)")

smoke: setup ## run the whole pipeline at toy size in build/smoke, apart from your results (minutes)
	@.ci/smoke

PYTEST := python -m pytest --numprocesses 2 --dist loadscope --no-loadscope-reorder --max-worker-restart 0

test: setup ## run the tests but for the slow ones (minutes)
	$(PYTEST) -m 'not slow'

test-all: setup ## run all tests, also those that are marked as slow: pipeline, pages, wheel, machines, campaigns, browser
	$(PYTEST)

mutants: setup ## make one wrong change at a time in the core and see whether a test fails; writes reports/mutants.md (half an hour)
	python -m tools.mutants

rosenv: setup
	@.ci/ros

ros: rosenv ## run the ROS 2 node with publishers and recorders on real middleware (not part of `make test-all`)
	PEDPRED_REQUIRE_ROS=1 python -m pytest --numprocesses 2 --max-worker-restart 0 tests/test_ros_node.py tests/test_ros_viewers.py

pythons: ## try the installation of a robot on other versions of Python: make pythons PYTHONS="python3.12 python3.13"
	@.ci/pythons $(PYTHONS)

trust: setup ## test the guarantees at length: damaged files, killed stages, a million frames (two to three hours)
	python -m tests.trust.campaign
	python -m tests.trust.faults
	python -m tests.trust.soak

# Not --quiet: it hides the warnings that --strict counts.
docs: setup ## build the documentation into build/site; fails on a broken link
	NO_MKDOCS_2_WARNING=1 mkdocs build --strict

readme: setup ## write the tables of results into README.md and docs/
	python -m tools.readme

dist: setup ## build the wheel and the source archive into build/dist
	build/packager/bin/python -m build --version > /dev/null 2>&1 || { python -m venv --clear build/packager && build/packager/bin/pip install --quiet build; }
	rm -rf build/dist
	build/packager/bin/python -m build --outdir build/dist .

audit: setup ## look up known vulnerabilities of the pinned dependencies at osv.dev (needs the network)
	build/audit/bin/pip-audit --version > /dev/null 2>&1 || { python -m venv --clear build/audit && build/audit/bin/pip install --quiet pip-audit; }
	build/audit/bin/pip-audit --requirement $(CONSTRAINTS) --no-deps --disable-pip --vulnerability-service osv

check: setup ## check lint, format, types, import contracts, params.yaml and the style of the pages
	ruff check .
	ruff format --check .
	mypy
	lint-imports
	python -m pedpred.config --check
	python -m tools.prose
