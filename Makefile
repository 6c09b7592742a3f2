# Two commands do all the set-up: `make demo` and `make test`. Both build .venv first.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
export PLUMBOB_DATA ?= $(abspath ../shared/data)

.PHONY: page papers pictures setup demo test test-long lint docs pages dist house mutants bench bench-doctor noise array arm view accuracy endurance wire fleet fuzz formats killed clean other-processor

setup: $(VENV)/.installed

$(VENV)/.installed: pyproject.toml
	$(PYTHON) -c 'import sys; v = sys.version_info; sys.exit(0 if v >= (3, 11) else f"Plumbob needs Python 3.11 or newer, but $(PYTHON) is {v.major}.{v.minor}. Say make PYTHON=python3.12")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade pip
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

# The live page and the script of reports, in src/plumbob/web. Without Node, Plumbob does all the rest.
page: web/.built

WEB_SOURCES := $(wildcard web/src/*.ts web/src/*/*.ts web/src/*/*/*.ts web/src/*.css web/src/*/*.css web/public/* web/index.html web/*.ts) web/package-lock.json
web/.built: $(WEB_SOURCES)
	@if ! command -v npm > /dev/null; then \
		echo "There is no npm here: the live page and reports are not built, and their tests are skipped. They need Node 20 or newer."; \
	elif ! node -e 'process.exit(parseInt(process.versions.node) >= 20 ? 0 : 1)'; then \
		echo "The live page needs Node 20 or newer, but this is $$(node --version): it is not built, and its tests are skipped."; \
	else \
		cd web && npm ci --no-audit --no-fund --silent && npm run --silent types && npm run --silent build && touch .built; \
	fi

$(VENV)/.bench: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[bench]'
	@touch $@

$(VENV)/.docs: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	@touch $@

demo: setup page
	$(BIN)/plumbob demo --out demo-out --force --view

# Two processes whose linear algebra takes two threads each wait for each other.
lint test test-long: export OMP_NUM_THREADS := 1
# Gates that only read: format, lint, types, layers.
lint: setup
	$(BIN)/python -m tests.gates lint

# Every gate; each runs whatever the others say.
test: setup page
	$(BIN)/python -m tests.gates test

# The long statistical runs, ten times the random cases, and the kernels' own tests again as plain Python.
test-long: setup
	$(BIN)/python -m tests.gates long

# How large the package is, how far a reader walks with a verb, and what nothing reaches, beside their budgets.
house: setup
	$(BIN)/python -m tests.gates.house --write

# The site: open site/index.html, which needs neither a server nor a network.
docs: export NO_MKDOCS_2_WARNING := 1
docs: $(VENV)/.docs
	$(BIN)/python -m mkdocs build --quiet
	@echo 'The site is in site/index.html.'

# The pages that a program makes; the tests say when they are out of date.
pages: setup
	$(BIN)/plumbob devices --markdown > docs/devices.md
	$(BIN)/python website/command_line.py > docs/command-line.md
	$(BIN)/python website/equations.py > docs/equations.md
	$(BIN)/python website/draw_house.py > docs/images/house.svg
	$(BIN)/python website/view_types.py > web/src/messages.ts

# The five papers' runs; from them docs/papers.md and the README's table: some minutes on two cores.
papers: setup
	$(BIN)/plumbob reproduce all --out reproduced --force
	$(BIN)/python website/papers.py reproduced/outcomes.json

# The pictures of README and docs, taken in Chromium of the pages themselves.
pictures: setup page
	$(BIN)/python website/pictures.py

# Source distribution, the wheel made of it, and what a user does with that: install it in a new environment, run the demo.
DIST := .venv-dist
dist: setup page
	rm -rf dist $(DIST)
	$(BIN)/python -m build --outdir dist . > /dev/null
	$(PYTHON) -m venv $(DIST)
	$(DIST)/bin/python -m pip install --quiet --disable-pip-version-check "$$(echo dist/*.whl)[plot]"
	cd $(DIST) && bin/plumbob demo --out demo-out --force
	@ls -l dist

# Faults planted one at a time, and whether the tests find them: about two hours of two cores.
mutants: setup
	$(BIN)/python benchmarks/mutants

bench: $(VENV)/.bench
	$(BIN)/python -m benchmarks.speed
	$(BIN)/python -m benchmarks.allan_speed
	$(BIN)/python -m benchmarks.calibration_speed
	$(BIN)/python -m benchmarks.startup

# Noise: coefficients and intervals on records of known noise, the intervals of a curve at every averaging time, and
# records with a band of motion.
noise: $(VENV)/.bench
	$(BIN)/python -m benchmarks.allan_quality
	$(BIN)/python -m benchmarks.allan_coverage
	$(BIN)/python -m benchmarks.allan_bands

# Conventions that are planted in recordings and simulations: found, not found, sure and wrong.
bench-doctor: setup
	$(BIN)/python -m benchmarks.doctor

# 64 units at 1 kHz as a stream: its memory, and its time beside one filter's.
array: setup
	$(BIN)/python -m benchmarks.arrays

# The live page under load: clients, latency, what the server costs, frames in the page.
view: setup page
	$(BIN)/python -m benchmarks.view_load
	$(BIN)/python -m benchmarks.view_page

# Filters, smoother and other libraries on the recordings under PLUMBOB_DATA, and docs/accuracy.md of it: about an hour.
accuracy: $(VENV)/.bench
	$(BIN)/python -m benchmarks.accuracy

# Chains of units: a real one beside its peers, simulated arms with truth, and programs that are taught: about ten minutes.
arm: $(VENV)/.bench
	$(BIN)/python -m benchmarks.arm

endurance: setup
	$(BIN)/python -m benchmarks.endurance

# Damaged streams, mutated bytes, decoding speed; recordings killed, damaged and full; ten minutes of a live line.
wire: setup
	$(BIN)/python -m benchmarks.decoder_faults
	$(BIN)/python -m benchmarks.decode_speed
	$(BIN)/python -m benchmarks.recorder_kill
	$(BIN)/python -m benchmarks.recorder_damage
	$(BIN)/python -m benchmarks.recorder_cost
	$(BIN)/python -m benchmarks.acquire_latency
	$(BIN)/python -m benchmarks.live --duration 600

# A thousand recordings, some damaged: threads, and a cluster that loses a worker; some minutes.
fleet: setup
	$(BIN)/python -m benchmarks.fleet

# Files of every kind through info, run and convert there and back, and docs/file-kinds.md of it: two minutes.
formats: setup
	$(BIN)/python -m benchmarks.formats --page

# Files of every format mutated, 5000 of each: exit codes, time and memory.
fuzz: setup
	$(BIN)/python -m benchmarks.fuzz

# Ten minutes of a recorder that is killed and started again; every verb that writes, killed and on a disk that fills.
killed: setup
	$(BIN)/python -m benchmarks.recorder_restart
	$(BIN)/python -m benchmarks.interrupted

clean:
	rm -rf $(VENV) $(DIST) .mutants demo-out bench-out build dist site web/node_modules web/.built src/plumbob/web

# The tests as a processor with SSE only would run them, which adds in another order, fuses no products and finds other last
# digits of a sine. The variables are read by numpy, numba, OpenBLAS and glibc.
other-processor: setup
	NPY_DISABLE_CPU_FEATURES="$$($(BIN)/python -c \
		'from numpy._core._multiarray_umath import __cpu_dispatch__ as names; print(*names)')" \
	NUMBA_CPU_NAME=generic OPENBLAS_CORETYPE=Nehalem OMP_NUM_THREADS=1 \
	GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F $(BIN)/python -m pytest -n 2 $(TESTS)
