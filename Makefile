# `make demo` and `make test` install what they need; `make` alone lists the targets.

PYTHON ?= python3.11
PYTHON313 ?= python3.13

# One environment for each tested Blender; the stamp file is newer than the lock it was made from.
READY50 := .venv/.ready
READY45 := .venv-bpy45/.ready
READY42 := .venv-bpy42/.ready
READY51 := .venv-bpy51/.ready
READY52 := .venv-bpy52/.ready
READY53 := .venv-bpy53/.ready

# Wheels that the packages contain, for every platform.
WHEELS := out/wheels/.ready
WHEELS_DASK := out/wheels_dask/.ready

.DELETE_ON_ERROR:
.PHONY: help demo test test-fast test-4.2 test-4.5 test-5.1 test-5.2 test-5.3 test-long package package-dask test-package test-package-short test-gui test-export gui-picture gallery fuzz-short fuzz verify bench bench-gpu lint setup locks clean

help: ## list the targets
	@grep -E '^[a-z0-9.-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z0-9.-]+):.*## /\1\t/' | expand -t 20

demo: $(READY50) ## bake a Cornell box headless; pictures and lightmap in out/demo
	@tools/system_packages.sh .venv/bin/python
	.venv/bin/python tools/demo.py --out out/demo

# Test files are spread over processes; each has its own Blender and needs 0.5 GB. Tests of Blender also wait for
# workers, timers and files, so there is one process more than cores.
PROCESSES := $(shell cores=$$(nproc); echo $$((cores < 3 ? cores + 1 : 4)))
PARALLEL := --numprocesses $(PROCESSES) --dist loadfile

test: lint ## lint, then all tests in Blender 5.0
	.venv/bin/python -m pytest $(PARALLEL)

test-fast: $(READY50) ## ruff, and the tests that need no device and no Blender
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/python -m pytest tests/unit $(PARALLEL)

test-4.2: $(READY42) ## the tests of Blender in 4.2
test-4.5: $(READY45) ## the tests of Blender in 4.5
test-5.1: $(READY51) ## the tests of Blender in 5.1; needs Python 3.13
test-5.2: $(READY52) ## the tests of Blender in 5.2; needs Python 3.13
test-5.3: $(READY53) ## the tests of Blender in 5.3; needs Python 3.13

test-4.2 test-4.5 test-5.1 test-5.2 test-5.3: test-%:
	@tools/system_packages.sh .venv-bpy$(subst .,,$*)/bin/python
	.venv-bpy$(subst .,,$*)/bin/python -m pytest tests/blender -m "not long and not one_version" $(PARALLEL)

# Some tests compare the speed of workers, so there are no more processes than cores.
test-long: setup ## the tests that take minutes
	.venv/bin/python -m pytest -m long --numprocesses auto --maxprocesses 4 --dist loadfile

fuzz-short: setup ## 300 random scenes and 60 random .blend files, the same ones in every run
	.venv/bin/python -m pytest tests/fuzz $(PARALLEL)

fuzz: SEED := $(or $(SEED),$(shell date +%s))
fuzz: setup ## 3,000 random scenes and 500 random .blend files, about an hour; SEED=N repeats a run
	@echo "SEED=$(SEED)"
	.venv/bin/python -m pytest tests/fuzz --hypothesis-profile=long --hypothesis-seed=$(SEED)

package: $(READY50) $(WHEELS) ## build the files to drag into Blender, one for each platform; in out/package
	.venv/bin/python -m tools.package out/wheels out/package --sizes README.md

package-dask: $(READY50) $(WHEELS_DASK) ## the same files with Dask, for bakes by several devices; in out/package_dask
	.venv/bin/python -m tools.package out/wheels_dask out/package_dask --sizes docs/user/several_devices.md

test-package: ## install the package into Blender 4.2 to 5.3, bake, upgrade, remove it, without a network
	@$(MAKE) --keep-going --no-print-directory $(READY42) $(READY45) $(READY51) $(READY52) $(READY53) || \
	    echo "Blenders whose environment could not be made are not tested." >&2
	@$(MAKE) --no-print-directory test-package-short

test-package-short: setup package ## the same in the Blenders that are there
	.venv/bin/python -m pytest tests/packaging

test-gui: setup $(WHEELS) ## bake, cancel, preview, mix, follow, undo and save in a real window of Debian's Blender; pictures in out/gui
	.venv/bin/python -m pytest tests/gui

test-export: setup ## show exported files with three.js, Babylon.js and PlayCanvas in headless Chromium, Godot 4 and Bevy, pixel by pixel against the preview
	.venv/bin/python -m pytest tests/export

gui-picture: package ## renew the pictures of Blender and of all panels in README.md and docs
	.venv/bin/python -m tools.gui.docs_picture out/package/hemibake-*-linux_x64.zip docs/user/pictures/blender.png
	.venv/bin/python -m tools.gui.live_picture out/package/hemibake-*-linux_x64.zip docs/user/pictures/live.png
	.venv/bin/python -m tools.gui.panel_pictures out/package/hemibake-*-linux_x64.zip docs/user/pictures

gallery: $(READY50) ## build, bake and export the gallery's scenes, and show them in Blender and all engines
	.venv/bin/python -m tools.gallery docs/gallery --page docs/gallery.md

verify: $(READY50) ## bake a suite of scenes with Hemibake and Cycles; the table goes to docs/design/accuracy.md
	@tools/system_packages.sh .venv/bin/python
	.venv/bin/python tools/verify.py --table docs/design/accuracy.md

bench: $(READY50) ## measure speed on this machine, about 5 minutes; tables, and JSON in benchmarks/results
	@tools/system_packages.sh .venv/bin/python
	.venv/bin/python benchmarks/run.py

bench-gpu: $(READY50) ## the same in sizes for a graphics card, which has to be there
	@tools/system_packages.sh .venv/bin/python
	.venv/bin/python benchmarks/run.py --gpu
	.venv/bin/python benchmarks/cards.py --bakes 2048x4096

lint: setup ## ruff and mypy
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/mypy

setup: $(READY50) ## make .venv and look for system libraries, nothing else
	@tools/system_packages.sh .venv/bin/python

# Compile the locks that are named, with the Python that is named first.
COMPILE = set -e; $(1) -m venv out/locks; out/locks/bin/pip install --quiet pip-tools; cd requirements; \
	for lock in $(2); do CUSTOM_COMPILE_COMMAND="make locks" ../out/locks/bin/pip-compile --quiet --upgrade \
	    --generate-hashes --strip-extras --no-emit-index-url --no-emit-find-links --no-emit-trusted-host \
	    $(3) --output-file $$lock.txt $$lock.in; done; rm -rf ../out/locks

locks: ## pin the newest versions that requirements/*.in allow; needs Python 3.11 and 3.13
	$(call COMPILE,$(PYTHON),bpy50 bpy45 bpy42,--allow-unsafe)
	$(call COMPILE,$(PYTHON),wheels wheels_dask,--unsafe-package numpy)
	$(call COMPILE,$(PYTHON313),bpy51 bpy52 bpy53,--allow-unsafe)

clean: ## remove what was made: environments, results, caches
	rm -rf .venv .venv-bpy4? .venv-bpy5? out .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(READY50): requirements/bpy50.txt
.venv-bpy%/.ready: requirements/bpy%.txt
	$(environment)

# Blender 5.1 brought Python 3.13.
$(READY51) $(READY52) $(READY53): needed := 3.13
$(READY51) $(READY52) $(READY53): python = $(PYTHON313)
needed := 3.11
python = $(PYTHON)

.venv/.ready:
	$(environment)

define environment
	@$(python) -c 'import sys; sys.exit("%d.%d" % sys.version_info[:2] != "$(needed)")' 2>/dev/null || { \
	    echo "Python $(needed) is needed for $(@D), which '$(python)' is not: its Blender runs in no other." >&2; \
	    echo "Install python$(needed) and python$(needed)-venv, or name one:" \
	        "make PYTHON$(subst 3.11,,$(subst 3.13,313,$(needed)))=/path/to/python$(needed)" >&2; \
	    exit 1; }
	@echo "Making $(@D): Blender as a Python module and what Hemibake needs, about 400 MB to download."
	rm -rf $(@D)
	$(python) -m venv $(@D)
	$(@D)/bin/pip install --quiet --disable-pip-version-check --require-hashes --requirement $<
	@touch $@
endef

out/%/.ready: requirements/%.txt tools/packages/platforms.py tools/packages/wheels.py | $(READY50)
	rm -rf $(@D)
	.venv/bin/python -m tools.packages.wheels $< $(@D)
	@touch $@
