PYTHON ?= $(shell command -v python3.11 || command -v python3)
BIN := .venv/bin

.PHONY: help install demo test lint fidelity bench-oracle conformance clean

help:  ## What can be made
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 14

install: .venv/.installed  ## Create .venv with everything in it

.venv/.installed: requirements.txt pyproject.toml
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet hatchling editables
	$(BIN)/pip install --quiet --no-build-isolation -r requirements.txt
	@touch $@

demo: install  ## One episode: find a couch and sit on it
	$(BIN)/humanclaw run --instruction "find a couch and sit on it" --scene house:0

test: install  ## All tests
	$(BIN)/python -m pytest

lint: install  ## Style, types and import rules
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy core/humanclaw
	$(BIN)/lint-imports

fidelity: install  ## Achieved against commanded motion, 200 rollouts a skill (minutes)
	$(BIN)/humanclaw fidelity

bench-oracle: install  ## 20 oracle episodes on 20 houses, and where the time goes (minutes)
	$(BIN)/python examples/oracle_houses.py

conformance: install  ## The MCP server against the official suite (needs npx)
	$(BIN)/python harnesses/mcp/conformance/run.py

clean:  ## Remove .venv and caches, keep runs
	rm -rf .venv .pytest_cache .mypy_cache .ruff_cache
