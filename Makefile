# Two commands for a newcomer: `make demo` and `make test`. `make help` lists the rest.
PYTHON ?= python3.11
VENV ?= .venv
BIN := $(VENV)/bin
READY := $(VENV)/.installed

.DEFAULT_GOAL := help
.PHONY: help install demo test check format bench compare-engines reproduce parametric power soak latency leaps faults fuzz clean

help: ## List the targets
	@awk -F':.*## ' '/^[a-z-]+:.*## / {printf "  make %-16s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

install: $(READY) ## Make the virtual environment and install everything into it

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt --editable '.[dev]'
	@touch $@

demo: $(READY) ## A simulated robot is identified over the wire, and the result is scored
	PATH="$(abspath $(BIN)):$$PATH" docs/demo.sh demo

TEST_JOBS ?= 2
test: $(READY) ## Run all tests, TEST_JOBS=2 side by side
	$(BIN)/python -m pytest --numprocesses $(TEST_JOBS) --dist worksteal

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

reproduce: $(READY) ## The paper's figures and claims, with statics; docs/reproduction.md says more
	$(BIN)/estimator reproduce all --physics statics

power: $(READY) ## How often the posterior is right, and whether it knows; about 20 minutes
	$(BIN)/python -m bench.power

parametric: $(READY) ## Leg lengths on the reported seeds; writes docs/parametric.md
	$(BIN)/python -m bench.parametric

soak: $(READY) ## 24 virtual hours of random commands, faults and clients; about 40 minutes
	$(BIN)/python -m bench.soak --hours 24

latency: $(READY) ## Round trips, jitter, memory and CPU of robotd; some minutes
	$(BIN)/python -m bench.latency

attacks: $(READY) ## Memory of robotd, and how long a stop waits, while it is attacked; three minutes
	$(BIN)/python -m bench.attacks

fuzz: $(READY) ## Two million frames through codec and server core; about seven minutes
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt 'atheris>=3.0'
	$(BIN)/python -m tests.fuzz.long

leaps: $(READY) ## A thousand faults in mid-motion, and a thousand on damaged lines; some minutes
	$(BIN)/python -m tests.faults.leaps

faults: $(READY) ## Write docs/faults.md from the fault matrix
	$(BIN)/python -m tests.faults.document

clean: ## Remove the virtual environment and caches
	rm -rf $(VENV) build *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
