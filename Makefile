# Everything that the project does has a target here. `make help` lists them.
SHELL := /bin/bash
.SHELLFLAGS := -o pipefail -c
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
DOCS_STAMP := $(VENV)/.installed-docs
BUILD_TOOLS := $(VENV)/.build_tools
BUILD := build/c
JOBS := $(shell nproc)
# One process more than cores, because some tests wait for processes, ports or real time.
TEST_JOBS := $(shell expr $(JOBS) + 1)
WORLDS ?= 522
RIG ?= virtual
HOURS ?= 24
RUNS ?= 20000
FULL_HAND ?= 10
SECONDS ?= 60
COUNT ?= 1000000
PORTS := firmware/boards
PARTS := psoc4200 psoc4100s
QUICK := protocol/tests $(addprefix host/tests/,cli emulated grasp hand link signal skin stream testing)
GUIDES := $(addprefix host/tests/,docs bench/test_bench_docs.py tools/test_tools_guide.py monitor/test_monitor_docs.py ros/test_record_guide.py cli/test_cli_import.py)
WITHOUT_HUB := boards commands compact fault_cases
EXECUTED := i2c commands hub_bootloader
SOURCES := pyproject.toml constraints.txt CMakeLists.txt $(shell find firmware host/taxel/grasp/native host/taxel/sim/native host/taxel/native_library/native \( -name '*.c' -o -name '*.h' -o -name 'CMakeLists.txt' \) -not -path 'firmware/fuzz/*' -not -path 'firmware/tests/*' -not -path 'firmware/boards/*' 2>/dev/null)
PIP = $(BIN)/python -m pip install --quiet --disable-pip-version-check
# The versions of constraints.txt have binary packages for Python 3.11; other versions take the newest ones.
CONSTRAINTS = $(shell $(BIN)/python -c 'import sys; print("-c constraints.txt" if sys.version_info[:2] == (3, 11) else "")')
CMAKE = $(BIN)/cmake -G Ninja -DCMAKE_MAKE_PROGRAM=$(abspath $(BIN)/ninja)

# Compiled modules are kept, so that the many processes that the tests start need not compile them again.
export PYTHONDONTWRITEBYTECODE :=

.DEFAULT_GOAL := help
.PHONY: help install check clients demo blind hil soak fuzz-states crash-writers proximity mutants test test-quick test-slow test-c test-threads test-python test-executed fuzz fuzz-short lint tidy terms lock wheels check-wheel bench bench-page firmware size generate docs docs-test format clean

help:  ## list the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*## */\t/' | sort | awk -F'\t' '{printf "  make %-14s %s\n", $$1, $$2}'

install: $(STAMP)  ## make the virtual environment and install taxel into it

$(BIN)/python:
	@PYTHON="$(PYTHON)" VENV="$(VENV)" tools/make_venv.sh

$(BUILD_TOOLS): $(BIN)/python constraints.txt
	@$(PIP) $(CONSTRAINTS) scikit-build-core cmake ninja
	@touch $@

$(STAMP): $(BUILD_TOOLS) $(SOURCES)
	@echo "installing taxel and what it needs (once; later runs reuse it)"
	@unset MAKEFLAGS; $(PIP) $(CONSTRAINTS) --no-build-isolation -e '.[test]'
	@touch $@

demo: $(STAMP)  ## the main job: a campaign on a hand with a hidden effect, its diagnosis, and the comparison with the hidden effect
	@$(BIN)/taxel demo --out out/demo

blind: $(STAMP)  ## the full blind check: hours; an interrupted check continues (WORLDS=24 for a short one)
	@$(BIN)/taxel gap blind --worlds $(WORLDS) --full-hand-worlds $(FULL_HAND) --out out/blind --page docs/blind-check.md

blind-streams: $(STAMP)  ## the blind check of the twin: hours (STREAMS=6 STREAM_HOURS=0.5 for a short one)
	@$(BIN)/python tools/twin/blind_streams.py --streams $(or $(STREAMS),150) --hours $(or $(STREAM_HOURS),2)

.PHONY: compare-baselines
compare-baselines: $(STAMP)  ## baseline policies after an hour of contact with drift, on WORLDS emulated worlds (minutes each)
	@$(BIN)/python tools/baseline/compare_baselines.py --worlds $(if $(filter command,$(firstword $(origin WORLDS))),$(WORLDS),6)

# The C tests are built while the packages of the Python part are installed.
test: $(BUILD_TOOLS)  ## everything that must pass before a merge: style, types, layers, terms, C and Python tests
	@$(MAKE) --no-print-directory --jobs 2 --output-sync=target test-c lint fuzz-short compiled-tests
	@$(MAKE) --no-print-directory test-python test-without-hub test-executed

check: $(STAMP)  ## below a minute, before each commit: style, types, layers, terms and the quick Python tests
	@$(MAKE) --no-print-directory --jobs 2 --output-sync=target lint test-quick

test-quick: $(STAMP)
	@$(BIN)/python -m pytest -q -n $(JOBS) --dist loadfile -m 'not slow' $(QUICK)

test-c: $(BUILD_TOOLS)  ## C tests, built with address and undefined-behaviour sanitizers
	@unset MAKEFLAGS; $(CMAKE) -S firmware -B $(BUILD)/sanitized -DTAXEL_BUILD_TESTS=ON -DTAXEL_SANITIZE=ON -DCMAKE_BUILD_TYPE=Debug -DCMAKE_C_FLAGS_DEBUG=-O1 > /dev/null
	@unset MAKEFLAGS; $(BIN)/cmake --build $(BUILD)/sanitized | tail -n 1
	@$(BIN)/ctest --test-dir $(BUILD)/sanitized --output-on-failure --no-tests=error -j $(JOBS)

test-threads: $(BUILD_TOOLS)  ## the emulator's threads under the thread sanitizer
	@$(CMAKE) -S firmware -B $(BUILD)/threads -DTAXEL_BUILD_TESTS=ON -DTAXEL_SANITIZE_THREADS=ON -DCMAKE_BUILD_TYPE=RelWithDebInfo > /dev/null
	@$(BIN)/cmake --build $(BUILD)/threads --target test_thread_pool test_effects_world | tail -n 1
	@$(BIN)/ctest --test-dir $(BUILD)/threads --output-on-failure --no-tests=error -R '^test_(thread_pool|effects_world)$$'

# Files in the order in which they are found: those that wait for real time come first, not alone at the end.
test-python: $(STAMP)  ## Python tests, without those that are marked slow; prints the ten slowest
	@$(BIN)/python -m pytest -q -n $(TEST_JOBS) --dist loadfile --no-loadscope-reorder --durations=10 -m 'not slow'

# Without the stored result of this step, each of the processes of test-python would compile all tests.
.PHONY: compiled-tests
compiled-tests: $(STAMP)
	@$(BIN)/python -m pytest -qq --collect-only > /dev/null || $(BIN)/python -m pytest -qq --collect-only | tail -n 40

test-slow: $(STAMP)  ## the Python tests that are marked slow: whole diagnoses and campaigns
	@$(BIN)/python -m pytest -q -n $(JOBS) --dist loadfile --durations=10 -m slow

.PHONY: test-times
test-times: $(STAMP)  ## choose the tests that `make test` leaves to `make test-slow`, by their times on this idle machine
	@$(BIN)/python -m pytest -q -n $(JOBS) --dist loadfile -p no:cacheprovider -o junit_duration_report=call --junitxml=build/test_times.xml > build/test_times.log || tail -n 40 build/test_times.log
	@$(BIN)/python tools/test_times/choose_slow_tests.py build/test_times.xml

.PHONY: coverage
coverage: $(STAMP)  ## functions that no command, example or guide reaches (an hour; needs `pip install coverage`)
	@$(BIN)/python -c 'import coverage' || { echo "coverage is missing: $(BIN)/pip install coverage"; exit 1; }
	@rm -rf out/coverage && mkdir -p out/coverage
	@export TAXEL_COVERAGE=$(abspath out/coverage); \
		TAXEL_DOCS=all $(BIN)/python -m coverage run --rcfile=tools/coverage/coverage.ini -m pytest -q $(GUIDES); \
		$(BIN)/python -m coverage combine -q --rcfile=tools/coverage/coverage.ini $$TAXEL_COVERAGE; \
		$(BIN)/python -m coverage json -q --rcfile=tools/coverage/coverage.ini -o out/coverage/commands.json
	@$(BIN)/python tools/coverage/unreached.py out/coverage/commands.json

.PHONY: test-without-hub
test-without-hub: $(STAMP)  ## boards, commands, faults and compact frames of a skin without a hub (`make hil RIG=i2c-dev`: all)
	@$(BIN)/python -m pytest -q -n $(JOBS) --dist loadfile --rig i2c-dev $(WITHOUT_HUB:%=hil_tests/test_hil_%.py)

test-executed: $(STAMP)  ## I2C, command and flash tests on images that are executed as ARM code (`make hil RIG=cortex-m0`, RIG=psoc4100s: all)
	@command -v arm-none-eabi-gcc > /dev/null || \
		{ echo "executed images are not tested: they need 'apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi'"; exit 0; }; \
	for rig in cortex-m0 psoc4100s; do \
		$(BIN)/python -m pytest -q -n $(JOBS) --dist loadfile --rig $$rig $(EXECUTED:%=hil_tests/test_hil_%.py) || exit 1; \
	done

fuzz: $(STAMP)  ## libFuzzer on codec, sensor and hub for SECONDS each (60); needs clang
	@$(BIN)/python tools/fuzz/run_targets.py --seconds $(SECONDS)

.PHONY: fuzz-files
fuzz-files: $(STAMP)  ## COUNT (1000000) mutated files for all readers of files: an error line, or the data of the file
	@$(BIN)/python tools/fuzz_files/run.py --count $(COUNT) --jobs $(JOBS)

# About a second for the slowest target; the number of executions does not depend on the load of the machine.
fuzz-short: $(STAMP)
	@$(BIN)/python tools/fuzz/run_targets.py --runs 12000 --if-possible

clients: $(STAMP)  ## compare all clients with the Python decoder on captures of 60 s of the emulated hand, intact and damaged
	@$(BIN)/python tools/clients/compare.py

hil: $(STAMP)  ## hardware in the loop on RIG (virtual, cortex-m0, psoc4100s, i2c-dev, or the file of a bench)
	@$(BIN)/python -m pytest -q hil_tests --rig $(RIG)

soak: $(STAMP)  ## HOURS (24) of virtual time with random faults: each missing frame must have a cause in the fault log
	@$(BIN)/python -m hil_tests.soak --hours $(HOURS) --out out/soak.json

fuzz-states: $(STAMP)  ## RUNS (20000) of 50 commands, faults and time steps in random order
	@$(BIN)/python -m hil_tests.states --runs $(RUNS) --jobs $(JOBS)

.PHONY: attack-web load-web
attack-web: $(STAMP)  ## 10,000 hostile requests and messages to the page of `taxel monitor --web`: none may be accepted
	@$(BIN)/python tools/attack/attack_web.py --out out/attack_web.json

load-web: $(STAMP)  ## 60 pages, slow readers and invalid frames for two minutes: constant memory of `taxel monitor --web`
	@$(BIN)/python tools/attack/load_web.py --seconds 120 --out out/load_web.json

# The files are in memory if possible, because each of the thousands of runs flushes its files to the disk.
crash-writers: $(STAMP)  ## kill every writer at every write call, and fail each call with ENOSPC and EIO (half an hour)
	@$(BIN)/python tools/crash/crash_writers.py --jobs $(JOBS) $(if $(wildcard /dev/shm),--folder /dev/shm)

proximity: $(STAMP)  ## accuracy of distances before contact on emulated skins with fresh seeds: half an hour; SEED, SKINS
	@$(BIN)/python tools/proximity/measure_proximity.py --skins $(or $(SKINS),8) --seed $(or $(SEED),1)

mutants: $(STAMP)  ## plant the bugs of tools/mutants/bugs.toml one at a time in a copy: the suite must detect each of them
	@$(BIN)/python tools/mutants/plant.py --jobs $(JOBS)

lint: $(STAMP)  ## ruff, clang-format, mypy, import-linter, stale generated files, terms of the glossary
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@git ls-files -z '*.c' '*.h' '*.cpp' '*.hpp' | xargs -0 $(BIN)/clang-format --dry-run --Werror
	@$(BIN)/mypy
	@$(BIN)/lint-imports --no-cache
	@$(BIN)/python tools/codegen/c_header.py --check
	@$(BIN)/python tools/codegen/vectors.py --check
	@$(BIN)/python tools/codegen/bootloader_header.py --check
	@$(BIN)/python tools/codegen/clients.py --check
	@$(BIN)/python tools/codegen/spec_tables.py --check
	@$(BIN)/python tools/codegen/page_terms.py --check
	@$(BIN)/python tools/wording/check_terms.py

terms:  ## words that the glossary replaces, in all tracked files
	@$(if $(wildcard $(BIN)/python),$(BIN)/python,$(PYTHON)) tools/wording/check_terms.py

lock: $(STAMP)  ## write constraints.txt: the versions of a new environment
	@$(BIN)/python tools/release/lock.py

.PHONY: audit
audit: $(STAMP)  ## published vulnerabilities of the versions in constraints.txt (needs `pip install pip-audit` and a connection)
	@$(BIN)/python tools/release/audit.py

wheels: $(STAMP)  ## sdist and manylinux_2_17 wheels for x86-64 and aarch64 in dist/
	@$(BIN)/python tools/release/build_wheels.py

check-wheel: $(STAMP)  ## install the wheel of this machine without repository and compiler, and run it: light core, then diagnosis
	@$(BIN)/python tools/release/check_wheel.py dist/*_$(shell uname -m).whl
	@$(BIN)/python tools/release/check_wheel.py dist/*_$(shell uname -m).whl --extra gap

# The analyzer does not finish on the jump table of execute.c. Tests and board drivers are compiled with other options.
TIDY_SOURCES = $(shell git ls-files 'firmware/*.c' | grep -v -e /tests/ -e /fuzz/ -e /boards/ -e cortex_m0/execute.c)

tidy: $(STAMP)  ## clang-tidy (.clang-tidy) on the C code, if it is installed (pip install clang-tidy)
	@tidy=$$(command -v $(BIN)/clang-tidy || command -v clang-tidy) || \
		{ echo "the C code is not analysed: 'make tidy' needs '$(BIN)/pip install clang-tidy==23.1.4'"; exit 0; }; \
	$(CMAKE) -S firmware -B $(BUILD)/tidy -DCMAKE_BUILD_TYPE=RelWithDebInfo -DCMAKE_EXPORT_COMPILE_COMMANDS=ON > /dev/null; \
	printf '%s\n' $(TIDY_SOURCES) | xargs -n 4 -P $(JOBS) $$tidy -p $(BUILD)/tidy --quiet

bench: $(STAMP)  ## speed, as ratios measured in one run
	@$(BIN)/python tools/bench/run.py

bench-page: $(STAMP)  ## the benchmarks, written to docs/benchmarks.md with the commit
	@$(BIN)/python tools/bench/run.py --page docs/benchmarks.md

firmware: $(STAMP)  ## firmware and emulator without sanitizers, and the images for PSoC 4200 and 4100S in build/PART/images
	@$(CMAKE) -S firmware -B $(BUILD)/release > /dev/null
	@$(BIN)/cmake --build $(BUILD)/release
	@echo "built: $(BUILD)/release/libtaxel_firmware.a, taxel-emulator, libtaxel_codec.so"
	@echo '#include <string.h>' | arm-none-eabi-gcc -E -x c - > /dev/null 2>&1 || \
		{ echo "no images: they need 'apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi'" >&2; exit 1; }
	@for part in $(PARTS); do \
		$(CMAKE) -S $(PORTS)/$$part -B build/$$part -DCMAKE_TOOLCHAIN_FILE=$(abspath $(PORTS))/$$part/toolchain.cmake \
			-DTAXEL_PYTHON=$(abspath $(BIN)/python) > /dev/null && $(BIN)/cmake --build build/$$part || exit 1; \
	done
	@echo "built: build/{psoc4200,psoc4100s}/images/{board,hub}-{a,b}.{bin,hex,cyacd}, {board,hub}.toml, {board,hub}-factory.hex; original boards: build/psoc4200/images/original/*.hex, one-slot/"

size: firmware  ## flash, RAM and stack of the images against their budgets: docs/firmware-size.md
	@for part in $(PARTS); do \
		git show HEAD:$(PORTS)/$$part/size.json > build/$$part/size-before.json 2> /dev/null || rm -f build/$$part/size-before.json; \
		page=docs/firmware-size$$(test $$part = psoc4200 || echo -$$part).md; \
		$(BIN)/python tools/firmware/firmware_size.py --part $$part --build build/$$part --json $(PORTS)/$$part/size.json --page $$page \
			$$(test -f build/$$part/size-before.json && echo --compare build/$$part/size-before.json) || exit 1; \
	done

generate: $(STAMP)  ## write the C header, vectors, clients, tables of the specification and terms of the gap page
	@$(BIN)/python tools/codegen/c_header.py
	@$(BIN)/python tools/codegen/vectors.py
	@$(BIN)/python tools/codegen/bootloader_header.py
	@$(BIN)/python tools/codegen/spec_tables.py
	@$(BIN)/python tools/codegen/clients.py
	@$(BIN)/python tools/codegen/page_terms.py

$(DOCS_STAMP): $(STAMP)
	@$(PIP) $(CONSTRAINTS) --no-build-isolation -e '.[docs]'
	@touch $@

docs: $(DOCS_STAMP)  ## the pages, commands and Python API as a site: build/docs/site/index.html (a broken link fails)
	@$(BIN)/python tools/docs/build_site.py

.PHONY: pictures
pictures: $(STAMP)  ## the pictures of README.md: a demonstration that is right, and the emulated skin (five minutes)
	@$(BIN)/python tools/docs/make_pictures.py

docs-test: $(STAMP)  ## run every code block of every page and every example of --help, also the long ones (half an hour)
	@TAXEL_DOCS=all $(BIN)/python -m pytest -q host/tests/docs

format: $(STAMP)  ## format the Python and C sources
	@$(BIN)/ruff check --fix --quiet . || true
	@$(BIN)/ruff format --quiet .
	@git ls-files -z '*.c' '*.h' '*.cpp' '*.hpp' | xargs -0 $(BIN)/clang-format -i

clean:  ## remove everything that was built
	rm -rf $(VENV) build out
