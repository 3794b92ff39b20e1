# Two commands for a newcomer: `make demo` and `make test`. `make help` lists the rest.
# 3.11 comes first: PyBullet has wheels for nothing newer. Then 3.13, which is tested, too.
PYTHONS := python3.11 python3.13 python3.12 python3.14 python3.15 python3
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.installed
COMPILED := $(VENV)/.compiled

.DEFAULT_GOAL := help
.PHONY: help install bench-peers demo demo-damage test test-newest wheel check docs format bench compare-engines reproduce after power ablations self-calibration soak three animation docs-commands screenshots latency attacks leaps calibration faults fuzz exports clean

help: ## List the targets
	@awk -F':.*## ' '/^[a-z-]+:.*## / {printf "  make %-16s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

PIP := pip install --quiet --disable-pip-version-check --no-compile -c constraints.txt
UV := uv pip install --quiet -c constraints.txt
# $(call into,PYTHON,WHAT): uv needs a fifth of pip's time; where only pip knows an index, pip does it.
into = ( $(1) -m $(PIP) uv && $(1) -m $(UV) $(2) ) || $(1) -m $(PIP) $(2)

# Names the best Python that is there, or PYTHON=..., and says why it is that one.
choose_python = for python in $(or $(PYTHON),$(PYTHONS)); do \
	version=$$($$python -c 'import sys, ensurepip, venv; assert sys.version_info >= (3, 11); \
		print(*sys.version_info[:2], sep=".")' 2> /dev/null) || continue; \
	if [ $$version = 3.11 ]; then why="has PyBullet on x86-64"; \
		else why="MuJoCo takes the place of PyBullet, which has wheels for 3.11 alone"; fi; \
	echo "Python $$version ($$python): $$why" >&2; echo $$python; exit; \
	done; echo "No Python of 3.11 or newer with venv: tried $(or $(PYTHON),$(PYTHONS))." \
		"Install one (apt install python3 python3-venv), or say PYTHON=/where/it/is" >&2; exit 1

install: $(READY) ## Make the virtual environment and install everything into it

$(READY): pyproject.toml constraints.txt
	@python=$$($(choose_python)) && $$python -m venv $(VENV)
	$(call into,$(BIN)/python,--editable '.[dev]')
	@touch $@

demo: $(READY) ## A simulated robot is identified over the wire, and the result is scored
	PATH="$(abspath $(BIN)):$$PATH" docs/demo.sh demo

demo-damage: $(READY) ## The robot is identified, loses half of a leg, notices, and finds out
	PATH="$(abspath $(BIN)):$$PATH" docs/demo-damage.sh demo-damage

# Tests start hundreds of processes: what these import is compiled once.
unexport PYTHONDONTWRITEBYTECODE

TEST_JOBS ?= 3
CALLS_ALL_MACHINE_CODE := tests/estimator/identification/test_posterior_method.py::test_a_run_that_is_sure_at_once_puts_it_to_the_test
$(COMPILED): $(READY)  # what all of them import and call is compiled by one of them
	$(BIN)/python -m pytest --quiet $(CALLS_ALL_MACHINE_CODE) > /dev/null
	@touch $@

test: $(COMPILED) ## Run all tests, TEST_JOBS=3 side by side: many wait for processes
	$(BIN)/python -m pytest --numprocesses $(TEST_JOBS) --dist worksteal

NEWEST ?= python3.13
NEWEST_VENV ?= .venv-newest
NEWEST_NEEDS := --editable '.[sim,estimator]' hypothesis psutil pytest pytest-timeout
NEWEST_SOURCE = $(abspath $(NEWEST_VENV))/source
test-newest: ## Run the tests that are marked every_python on another Python, NEWEST=python3.13
	$(NEWEST) -m venv --clear $(NEWEST_VENV)
	mkdir $(NEWEST_SOURCE)  # what two environments install at once from one folder gets mixed up
	git ls-files -z | xargs -0 cp --parents --target-directory $(NEWEST_SOURCE)
	cd $(NEWEST_SOURCE) && $(call into,../bin/python,$(NEWEST_NEEDS))
	cd $(NEWEST_SOURCE) && ../bin/python -m pytest -m every_python \
		$$(grep -rl --include='*.py' 'mark.every_python' tests)

wheel: ## Build the wheel and the source distribution into dist/, and try both in clean environments
	rm -rf build dist  # setuptools would also pack what is left of earlier builds
	@python=$$($(choose_python)) && $$python -m venv build/venv
	build/venv/bin/python -m $(PIP) 'setuptools>=77'
	build/venv/bin/python -c 'from setuptools.build_meta import *; build_wheel("dist"); build_sdist("dist")' > build/log
	set -e; for built in dist/*.whl dist/*.tar.gz; do \
		build/venv/bin/python -m venv --without-pip --clear build/clean; \
		build/venv/bin/python -m $(subst pip install,pip --python build/clean/bin/python install,$(PIP)) $$built; \
		( cd build/clean/bin; ./robotd --version; ./robotd drivers > log; \
			./robotd new --electronics pi robot.toml; ./python -m protocol --help > log ); \
	done
	@ls dist/*

check: $(READY) ## Lint, format, types and import arrows
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: $(READY) ## Put the sources into their format
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: $(READY) ## Print what an interaction, an idle daemon and a simulation cost
	$(BIN)/python -m bench

BODIES ?= 1000
SEED ?= 0
compare-engines: $(READY) ## Statics against PyBullet and MuJoCo; BODIES=1000 SEED=0, three minutes
	$(BIN)/python -m bench.engines --bodies $(BODIES) --seed $(SEED) $(COMPARE)

reproduce: $(READY) ## The paper's figures and claims, with statics; docs/accuracy.md says more
	$(BIN)/estimator reproduce all --physics statics

self-calibration: $(READY) ## Does the posterior mean what it says? 300 bodies, statics as the robot; hours
	$(BIN)/python -m bench.simulation_based_calibration

power: $(READY) ## Each method on the reported seeds, other bodies, faults; writes docs/runs
	$(BIN)/python -m bench.power --publish

ablations: $(READY) ## The method with one part left out at a time, on development seeds; twenty minutes
	$(BIN)/python -m bench.power.ablations

AFTER ?=
after: $(READY) ## Poses, changes noticed and named, false alarms; hours; AFTER='--seeds 1 --quiet 40 --goals 20'
	$(BIN)/python -m bench.after $(AFTER)
bench-peers: $(READY) ## Our search beside public optimisers and samplers, same readings; half an hour
	$(call into,$(BIN)/python,--editable '.[peers]')
	$(BIN)/python -m bench.peers $(PEERS)

SOAK ?=
soak: $(READY) ## 24 virtual hours of random commands, faults, clients; 40 minutes; SOAK='--electronics pi'
	$(BIN)/python -m bench.soak --hours 24 $(SOAK)

latency: $(READY) ## Round trips, jitter, memory and CPU of robotd; some minutes
	$(BIN)/python -m bench.latency

attacks: $(READY) ## Memory of robotd, and how long a stop waits, while it is attacked; three minutes
	$(BIN)/python -m bench.attacks

fuzz: $(READY) ## Two million frames through codec and server core; about seven minutes
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt 'atheris>=3.0'
	$(BIN)/python -m tests.fuzz.long

leaps: $(READY) ## A thousand faults in mid-motion, and a thousand on damaged lines; some minutes
	$(BIN)/python -m tests.faults.leaps

calibration: $(READY) ## Wrong electronics of every kind, ten seeds each, put right by a simulated person
	ALL_SEEDS=1 $(BIN)/python -m pytest -q tests/sim_robot/simulator/test_calibrate.py

exports: $(READY) ## Exported bodies of all robots that ship, at rest for 20 s in MuJoCo and PyBullet
	ALL_BODIES=1 $(BIN)/python -m pytest -q tests/docs/test_export.py

faults: $(READY) ## Write docs/faults.csv, the fault matrix
	$(BIN)/python -m tests.faults.document

THREE := estimator/report/page
three: ## Bundle what the pages need of three.js, from npm: needs node
	npm install --silent --ignore-scripts --no-save --prefix build/npm three@0.187.0 esbuild@0.28.2
	cp $(THREE)/three.js build/npm/
	build/npm/node_modules/.bin/esbuild build/npm/three.js --bundle --minify --format=iife \
		--global-name=THREE --legal-comments=inline --outfile=$(THREE)/three.min.js
	cp build/npm/node_modules/three/LICENSE $(THREE)/three.LICENSE

docs: $(READY) ## Build the documentation as a site into build/docs
	$(BIN)/python -m sphinx --quiet --fail-on-warning --builder html docs build/docs
	@echo "build/docs/index.html"

docs-commands: $(READY) ## Run the commands of README and first page as they stand; ten minutes
	ALL_EFFORT=1 $(BIN)/python -m pytest -q --timeout 3600 tests/docs/test_readme.py

animation: $(READY) ## Make README's moving picture of a body being found; a minute
	PATH="$(abspath $(BIN)):$$PATH" $(BIN)/python -m bench.animation

screenshots: $(READY) ## Take the documentation's pictures of report.html, of a run; three minutes
	PATH="$(abspath $(BIN)):$$PATH" $(BIN)/python -m tests.estimator.report.page.screenshots docs/images

clean: ## Remove the virtual environment and caches
	rm -rf $(VENV) $(NEWEST_VENV) build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
