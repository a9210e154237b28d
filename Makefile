# Lightloom. `make` alone lists the targets. Everything is installed into .venv in this folder, from the pinned versions
# in requirements.lock; the system's Python is only used to make that environment.

PYTHON  ?= python3
VENV    := .venv
BIN     := $(VENV)/bin
READY   := $(VENV)/.ready
BUNNY   := build/meshes/bunny.obj
DRAGON  := build/meshes/dragon.ply
WORKERS ?= 2

.DEFAULT_GOAL := help
.PHONY: help setup simulators meshes demo test tests lint test-long test-operators test-texels prove coverage bench results emit clean distclean

help: ## this list
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 18

setup: $(READY) simulators meshes ## install everything that the other targets need

# The lock file is the whole closure, so nothing is resolved: what is not in it is not installed.
$(READY): requirements.lock pyproject.toml
	@.ci/setup venv $(PYTHON) $(VENV)
	@touch $@

simulators:
	@.ci/setup simulators

meshes: $(BUNNY) $(DRAGON)

$(BUNNY):
	@.ci/setup bunny $@

$(DRAGON): | $(READY)
	@.ci/setup dragon $@

demo: setup ## render the Cornell box, replay its triangle tests through the Verilog, write build/demo/
	$(BIN)/lightloom demo --out build/demo

# Types take one core for a minute, and so do not go before the tests, but beside them.
test: setup ## lint, types and all tests but the long ones
	@$(MAKE) --no-print-directory --jobs 2 lint tests

# Each worker begins with a stretch of files of its own, so that what the tests of a file share is made once; who is done
# takes from the other's.
tests: setup
	$(BIN)/pytest -n $(WORKERS) --dist worksteal -m "not long"

lint: $(READY) ## ruff (lint and format) and mypy
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

test-long: setup ## the long tests: millions of rays and vectors, films against Mitsuba (two hours on two cores)
	$(BIN)/pytest -n $(WORKERS) -m long

test-operators: setup ## number units: 4 million random vectors and the corner grid each, against SoftFloat; a table
	$(BIN)/python -m tests.operators_long --json build/operators.json

test-texels: setup ## units of texels: 2 million seeded operands each and all calls of the films (an hour); a table
	$(BIN)/python -m tests.texels_long --json build/texels.json

prove: $(READY) ## all proofs of the RTL, then seeded faults and what notices them (minutes)
	$(BIN)/lightloom prove --jobs $(WORKERS)
	$(BIN)/lightloom prove --mutations --jobs $(WORKERS)

coverage: setup ## what the benches reach of the Verilog: branches, edges, bins (ten minutes); build/coverage/
	$(BIN)/lightloom coverage

bench: setup ## measure: vectors a second, rays a second, emission time
	$(BIN)/lightloom bench

results: setup ## measure what docs/results.md shows, with the PDKs below PDK_ROOT (hours; goes on where it was)
	$(BIN)/python -m lightloom.pages.measure --pdk-root $(PDK_ROOT)
	$(BIN)/python -m lightloom.pages.results build/results/*.json
	$(BIN)/python -m lightloom.pages.arithmetic > docs/arithmetic.md

emit: $(READY) ## Verilog and manifests of every unit into build/verilog/
	$(BIN)/lightloom emit --out build/verilog

clean: ## remove what was built, keep the environment
	rm -rf build

distclean: clean ## remove the environment too
	rm -rf $(VENV)
