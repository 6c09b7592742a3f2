# Two commands do all the set-up: `make demo` and `make test`. Both build .venv first. `make help` prints every target.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
export PLUMBOB_DATA ?= $(abspath ../shared/data)
unexport PYTHONDONTWRITEBYTECODE  # with it every process would compile the package's bytecode again

# Two processes whose linear algebra takes two threads each wait for each other.
lint test test-all test-second test-long costs: export OMP_NUM_THREADS := 1

##@ Every day
demo: setup page  ## the main job on emulated bytes, with a report and the live page to look at
	$(BIN)/plumbob demo --out demo-out --force --view

test: setup page  ## every gate, each whatever the others say; papers, rigs, page and arm where their files changed
	$(BIN)/python -m gates test

lint: setup  ## the gates that only read: format, lint, types, layers, the size of the house
	$(BIN)/python -m gates lint

house: setup  ## print the size of the house beside house.toml, and write down what fell
	$(BIN)/python -m gates.house --write

pages: setup  ## the pages that a program makes; the tests say when they are out of date
	$(BIN)/plumbob list devices --markdown > docs/devices.md
	$(BIN)/python website/command_line.py > docs/command-line.md
	$(BIN)/python website/equations.py > docs/equations.md
	$(BIN)/python website/draw_house.py > docs/images/house.svg
	$(BIN)/python website/view_types.py > web/src/messages.ts
	$(BIN)/python website/sentences.py > tests/docs/sentences.txt

##@ More tests
test-all: setup page  ## as 'test', with every group
	$(BIN)/python -m gates test --all

test-second: setup page  ## types, imports, and the tests in which Pythons differ: PYTHON=python3.13 VENV=.venv-3.13
	$(BIN)/python -m gates second

test-long: setup  ## dear statistics and ten times the random cases, of the rooms that changed last
	$(BIN)/python -m gates long

# NumPy, OpenBLAS and glibc read these: sums in another order, no fused products, other last digits of a sine.
other-processor: setup  ## tests as a processor with SSE only would run them: TESTS=tests/noise
	NPY_DISABLE_CPU_FEATURES="$$($(BIN)/python -c \
		'from numpy._core._multiarray_umath import __cpu_dispatch__ as names; print(*names)')" \
	OPENBLAS_CORETYPE=Nehalem OMP_NUM_THREADS=1 \
	GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F $(BIN)/python -m pytest -n 2 --dist loadfile $(TESTS)

loaded: setup  ## three times the tests beside four busy loops, then once in random order: SEED=1
	$(BIN)/python -m gates.loaded

costs: setup  ## what the tests cost: CPU seconds by folder, those that compile among them, and the dearest tests
	$(BIN)/python -m gates costs --all

mutants: setup  ## plant faults one at a time and print which the tests miss: about an hour of two cores
	$(BIN)/python benchmarks/mutants

##@ Pages, site, package
page: web/.built  ## the live page and the script of reports, in src/plumbob/web; needs Node 20 or newer

docs: export NO_MKDOCS_2_WARNING := 1
docs: $(VENV)/.docs  ## the site in site/index.html, which needs neither a server nor a network
	$(BIN)/python -m mkdocs build --quiet
	@echo 'The site is in site/index.html.'

papers: setup  ## the five papers' runs, docs/papers.md and the README's table: some minutes
	$(BIN)/plumbob reproduce all --out reproduced --force
	$(BIN)/python website/papers.py reproduced/outcomes.json

pictures: setup page  ## the pictures of README and docs, taken in Chromium of the pages themselves
	$(BIN)/python website/pictures.py

DIST := .venv-dist
dist: setup page  ## source distribution and wheel, and that installed in a new environment, with its demo
	rm -rf dist $(DIST)
	$(BIN)/python -m build --outdir dist . > /dev/null
	$(PYTHON) -m venv $(DIST)
	$(DIST)/bin/python -m pip install --quiet --disable-pip-version-check "$$(echo dist/*.whl)[plot]"
	cd $(DIST) && env -i PATH="$$PWD/bin" HOME="$$PWD" plumbob demo --out demo-out --force  # no compiler is found
	@ls -l dist

wheels: setup page  ## wheels for other machines, by zig's compiler: TARGETS=manylinux_2_28_aarch64
	for target in $${TARGETS:-$$($(BIN)/python -c 'from plumbob.core.kernels.build import TARGETS; print(*TARGETS)')}; \
		do PLUMBOB_TARGET=$$target $(BIN)/python -m build --wheel --outdir dist . > /dev/null || exit 1; done
	@ls -l dist

##@ Measurements, printed as ratios to other programs where there are any
bench: $(VENV)/.bench  ## speed of filters, Allan deviations, calibrations and the start
	$(BIN)/python -m benchmarks.speed
	$(BIN)/python -m benchmarks.allan_speed
	$(BIN)/python -m benchmarks.calibration_speed
	$(BIN)/python -m benchmarks.startup

accuracy: $(VENV)/.bench  ## filters, smoother and other libraries on real recordings, their time, and docs/accuracy.md: about an hour
	$(BIN)/python -m benchmarks.accuracy
	$(BIN)/python -m benchmarks.smoother_speed

noise: $(VENV)/.bench  ## noise coefficients and intervals on records of known noise, and with a band of motion
	$(BIN)/python -m benchmarks.allan_quality
	$(BIN)/python -m benchmarks.allan_coverage
	$(BIN)/python -m benchmarks.allan_bands

bench-doctor: setup  ## planted conventions: found, not found, sure and wrong
	$(BIN)/python -m benchmarks.doctor

wrong-inputs: setup  ## 300 wrong files of all kinds: refused, flagged with the cause, misleading, silent
	$(BIN)/python -m benchmarks.wrong_inputs

arm: $(VENV)/.bench  ## chains of units beside their peers, simulated arms, taught programs: about ten minutes
	$(BIN)/python -m benchmarks.arm

array: setup  ## 64 units at 1 kHz as a stream: memory, and time beside one filter's
	$(BIN)/python -m benchmarks.arrays

view: setup page  ## the live page under load: clients, latency, what the server costs, frames in the page
	$(BIN)/python -m benchmarks.view_load
	$(BIN)/python -m benchmarks.view_page

fleet: setup  ## a thousand recordings, some damaged: processes, and a cluster that loses a worker
	$(BIN)/python -m benchmarks.fleet

##@ Endurance and damage
endurance: setup  ## every filter through 1e8 steps
	$(BIN)/python -m benchmarks.endurance

wire: setup  ## damaged streams and recordings, killed recorders, and ten minutes of a live line
	$(BIN)/python -m benchmarks.decoder_faults
	$(BIN)/python -m benchmarks.decode_speed
	$(BIN)/python -m benchmarks.recorder_kill
	$(BIN)/python -m benchmarks.recorder_damage
	$(BIN)/python -m benchmarks.recorder_cost
	$(BIN)/python -m benchmarks.acquire_latency
	$(BIN)/python -m benchmarks.live --duration 600

killed: setup  ## ten minutes of a recorder that is killed; every verb that writes, killed and on a disk that fills
	$(BIN)/python -m benchmarks.recorder_restart
	$(BIN)/python -m benchmarks.interrupted

formats: setup  ## files of every kind through info, run and convert there and back, and docs/file-kinds.md
	$(BIN)/python -m benchmarks.formats --page

fuzz: setup  ## files of every format mutated, 5000 of each: exit codes, time and memory
	$(BIN)/python -m benchmarks.fuzz

##@ Set-up
setup: $(VENV)/.installed  ## the environment in .venv, which all targets make

clean:  ## delete all that was made
	rm -rf $(VENV) $(DIST) src/plumbob/_kernels.* .mutants demo-out bench-out build dist site web/node_modules web/.built src/plumbob/web

help:  ## this
	@awk -F ':.*## ' '/^##@/ {printf "\n%s\n", substr($$0, 5)} /^[a-z-]+:.*## / {printf "  make %-16s%s\n", $$1, $$2}' Makefile

$(VENV)/.installed: pyproject.toml
	$(PYTHON) -c 'import sys; v = sys.version_info; sys.exit(0 if v >= (3, 11) else f"Plumbob needs Python 3.11 or newer, but $(PYTHON) is {v.major}.{v.minor}. Say make PYTHON=python3.12")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade pip
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

$(VENV)/.bench $(VENV)/.docs: $(VENV)/.%: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[$*]'
	@touch $@

# Without Node, Plumbob does all but the live page and the drawings of reports.
WEB_SOURCES := $(wildcard web/src/*.ts web/src/*/*.ts web/src/*/*/*.ts web/src/*.css web/src/*/*.css web/public/* web/index.html web/*.ts) web/package-lock.json
web/.built: $(WEB_SOURCES)
	@if ! command -v npm > /dev/null; then \
		echo "There is no npm here: the live page and reports are not built, and their tests are skipped. They need Node 20 or newer."; \
	elif ! node -e 'process.exit(parseInt(process.versions.node) >= 20 ? 0 : 1)'; then \
		echo "The live page needs Node 20 or newer, but this is $$(node --version): it is not built, and its tests are skipped."; \
	else \
		cd web && npm ci --no-audit --no-fund --silent && npm run --silent types && npm run --silent build && touch .built; \
	fi

.PHONY: accuracy arm array bench bench-doctor clean costs demo dist docs endurance fleet formats fuzz help house killed lint \
	loaded mutants noise other-processor page pages papers pictures setup test test-all test-long test-second view wheels \
	wire wrong-inputs
.DEFAULT_GOAL := help
