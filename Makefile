# The verbs of this project. Every one sets itself up: a virtual environment in .venv, from pinned versions.
.DEFAULT_GOAL := help
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# The index of PyTorch's CPU builds; empty: the ordinary index alone (it may bring gigabytes of CUDA).
TORCH_INDEX ?= https://download.pytorch.org/whl/cpu
TEST ?=
SEEDS ?= 0:1000

.PHONY: help setup demo test check bench storm picture clean

help: ## list the verbs
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/make \1|\2/p' Makefile | column -t -s '|'

setup: $(VENV)/.ready ## make .venv with everything in it

$(VENV)/.ready: pyproject.toml constraints.txt scripts/setup
	@PYTHON="$(PYTHON)" TORCH_INDEX="$(TORCH_INDEX)" scripts/setup $(VENV) dev
	@touch $(VENV)/.demo $@

$(VENV)/.demo: pyproject.toml constraints.txt scripts/setup
	@PYTHON="$(PYTHON)" scripts/setup $(VENV) demo
	@touch $@

demo: $(VENV)/.demo ## watch it learn, and see how good it is: about a minute once set up
	@$(BIN)/phototaxis demo --seed 1

test: setup ## all tests, with real processes on a real bus
	@scripts/test $(BIN)/python $(TEST)

check: setup ## style, types
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/pyright

bench: setup ## measure rates and costs on this machine
	@$(BIN)/python benchmarks/run.py

storm: setup ## schedules of faults on a simulated network, SEEDS=FIRST:LAST EPOCHS=N; TRACE=1 prints what happens, COVERAGE=1 counts transitions
	@PYTHONPATH=tests $(BIN)/python -m simulated $(SEEDS)

picture: setup ## the README's picture and animation, from a real run
	@scripts/picture

clean: ## remove .venv and caches; runs/ stays
	rm -rf $(VENV) .pytest_cache .ruff_cache
	find . -name __pycache__ -prune -exec rm -rf {} +
