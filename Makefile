# `make demo` and `make test` set up all they need themselves; `make` alone lists the targets.

PYTHON ?= python3.11

# One environment for each Blender that is tested; a stamp tells which lock it was made from.
READY50 := .venv/.ready
READY45 := .venv-bpy45/.ready

.DELETE_ON_ERROR:
.PHONY: help demo test test-4.5 test-long fuzz-short fuzz verify bench bench-gpu lint setup locks clean

help: ## list the targets
	@grep -E '^[a-z0-9.-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z0-9.-]+):.*## /\1\t/' | expand -t 14

demo: $(READY50) ## bake a Cornell box headless; pictures and lightmap in out/demo
	@tools/system_packages.sh .venv/bin/python
	.venv/bin/python tools/demo.py --out out/demo

test: lint ## lint, then all tests in Blender 5.0
	.venv/bin/python -m pytest

test-4.5: setup $(READY45) ## the tests of Blender in 4.5
	.venv-bpy45/bin/python -m pytest tests/blender

test-long: setup ## the tests that take minutes
	.venv/bin/python -m pytest -m long

fuzz-short: setup ## 300 random scenes and 60 random .blend files, the same ones in every run
	.venv/bin/python -m pytest tests/fuzz

fuzz: SEED := $(or $(SEED),$(shell date +%s))
fuzz: setup ## 3,000 random scenes and 500 random .blend files, about an hour; SEED=N repeats a run
	@echo "SEED=$(SEED)"
	.venv/bin/python -m pytest tests/fuzz --hypothesis-profile=long --hypothesis-seed=$(SEED)

verify: $(READY50) ## bake a suite of scenes with Hemibake and Cycles; the table goes to docs/accuracy.md
	@tools/system_packages.sh .venv/bin/python
	.venv/bin/python tools/verify.py --table docs/accuracy.md

bench: $(READY50) ## measure speed on this machine, about 5 minutes; tables, and JSON in benchmarks/results
	@tools/system_packages.sh .venv/bin/python
	.venv/bin/python benchmarks/run.py

bench-gpu: $(READY50) ## the same in sizes for a graphics card, which has to be there
	@tools/system_packages.sh .venv/bin/python
	.venv/bin/python benchmarks/run.py --gpu

lint: setup ## ruff, and mypy for the engine
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/mypy

setup: $(READY50) ## make .venv and look for system libraries, nothing else
	@tools/system_packages.sh .venv/bin/python

locks: ## pin the newest versions that requirements/*.in allow
	$(PYTHON) -m venv out/locks
	out/locks/bin/pip install --quiet pip-tools
	cd requirements && for version in 50 45; do \
	    CUSTOM_COMPILE_COMMAND="make locks" ../out/locks/bin/pip-compile --quiet --upgrade --generate-hashes \
	        --allow-unsafe --strip-extras --no-emit-index-url --no-emit-find-links --no-emit-trusted-host \
	        --output-file bpy$$version.txt bpy$$version.in || exit 1; done

clean: ## remove what was made: environments, results, caches
	rm -rf .venv .venv-bpy45 out .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(READY50): requirements/bpy50.txt
$(READY45): requirements/bpy45.txt

.venv/.ready .venv-bpy45/.ready:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' 2>/dev/null || { \
	    echo "Python 3.11 is needed, which '$(PYTHON)' is not: Blender 4.5 and 5.0 run in no other." >&2; \
	    echo "Install python3.11 and python3.11-venv, or name one: make PYTHON=/path/to/python3.11" >&2; \
	    exit 1; }
	@echo "Making $(@D): Blender as a Python module and what Hemibake needs, about 400 MB to download."
	rm -rf $(@D)
	$(PYTHON) -m venv $(@D)
	$(@D)/bin/pip install --quiet --disable-pip-version-check --require-hashes --requirement $<
	@touch $@
