# Every target sets up what it needs: a virtual environment with pinned packages, then the work.
# Needs Python >= 3.11 and make. PYTHON selects another interpreter.

PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
OUT    ?= campaign
SEED   ?= 1
# FORCE=1 replaces the campaign that $(OUT) holds; without it `ground campaign` refuses
FORCE  ?=
# Folder of the environment that `make vehicle` creates
VEHICLE ?= .venv-vehicle
# How pip is called. A lock file names the hashes of all files of a version, so that an installation
# accepts these files only, on every platform; --require-hashes refuses a line without a hash.
INSTALL := install -q --disable-pip-version-check
COMPILE := pip-compile -q --generate-hashes --no-strip-extras --no-header --annotation-style=line \
  --no-emit-index-url --no-emit-find-links --no-emit-trusted-host
# `make soak`: fraction of the sizes of the table, 1 runs for days; MINUTES=N ends earlier, to continue later
SIZE   ?=
MINUTES ?=
# `make fuzz`: time for each of the targets
SECONDS ?= 20
# Further arguments of pytest
PYTEST ?=
# `make bench`: BUSY=1 loads every core meanwhile; ROWS=NAME,... measures only these
BUSY   ?=
ROWS   ?=

.PHONY: help demo campaign test test-fast test-clients check check-physics benchmark-sysid benchmark-control \
        benchmark-campaigns bench soak fuzz docs format coverage audit vehicle lock clean

help:                                ## list the targets
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*##/	/' | expand -t 20

demo: $(VENV)/run.stamp             ## fly a simulated vehicle and show it live in a browser
	$(BIN)/ground demo

campaign: $(VENV)/run.stamp          ## fly, identify, redesign, fly again; report in $(OUT)/report.html
	$(BIN)/ground campaign --seed $(SEED) --out $(OUT) $(if $(FORCE),--force)

test: $(VENV)/dev.stamp check        ## run all checks and tests
	$(BIN)/python -m pytest -n 3 --dist loadfile --no-loadscope-reorder $(PYTEST)

test-fast: $(VENV)/dev.stamp check   ## run the checks and the tests without processes
	$(BIN)/python -m pytest -n 2 --dist worksteal -m "not process and not slow" $(PYTEST)

test-clients: $(VENV)/dev.stamp      ## MAVSDK, MAVProxy and other clients on every link: pass counts
	$(BIN)/python -m tests.clients

check: $(VENV)/dev.stamp             ## lint, formatter, types, import contracts, language, docstrings
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m tests.language
	$(BIN)/python -m tests.docstrings

check-physics: $(VENV)/dev.stamp     ## every physics check: value, reference, tolerance
	$(BIN)/python -m tests.reference

benchmark-sysid: $(VENV)/dev.stamp   ## identification accuracy over 200 campaigns a cell; resumes
	$(BIN)/python -m benchmarks.identification $(STUDY)

benchmark-control: $(VENV)/dev.stamp ## redesigned gains against the paper's in many seas; resumes
	$(BIN)/python -m benchmarks.redesign $(FLIGHTS)

benchmark-campaigns: $(VENV)/dev.stamp ## campaigns of eight unlike vehicles, five seeds each; resumes
	$(BIN)/python -m benchmarks.campaigns $(FLIGHTS)

bench: $(VENV)/dev.stamp             ## speed of every part beside floors and peers; writes docs/performance.md
	$(BIN)/python -m benchmarks $(if $(BUSY),--busy) $(if $(ROWS),--rows $(ROWS))
	$(BIN)/python -m benchmarks.page

soak: $(VENV)/dev.stamp              ## robustness table: SIZE=fraction of the required sizes; resumes
	$(BIN)/python -m tests.soak $(if $(SIZE),--size $(SIZE)) $(if $(ROWS),--rows $(ROWS)) $(if $(MINUTES),--minutes $(MINUTES))

fuzz: $(VENV)/dev.stamp              ## coverage-guided fuzzing (atheris): SECONDS for each link and reader
	$(BIN)/python -m pip $(INSTALL) "atheris>=3.0"
	$(BIN)/python -m tests.fuzz all -max_total_time=$(SECONDS)

docs: $(VENV)/dev.stamp             ## documentation site in build/docs; a warning is an error
	$(BIN)/python -m sphinx -q -W --keep-going docs build/docs

format: $(VENV)/dev.stamp            ## apply the formatter and the safe lint fixes
	$(BIN)/ruff check --fix -q . || true
	$(BIN)/ruff format .

coverage: $(VENV)/dev.stamp          ## line coverage of the tests without processes
	$(BIN)/python -m pytest -n 2 -m "not process" --cov --cov-report=term $(PYTEST)

audit: $(VENV)/dev.stamp             ## known vulnerabilities of the pinned packages (needs a network)
	$(BIN)/python -m pip $(INSTALL) pip-audit
	$(BIN)/python -m pip_audit -r requirements/run.lock --require-hashes --disable-pip --strict

lock:                                ## renew the pinned versions and their hashes (needs pip-tools)
	$(COMPILE) -o requirements/run.lock pyproject.toml
	$(COMPILE) --extra dev -o requirements/dev.lock pyproject.toml
	awk 'NR == FNR {wanted[$$1]; next} /^[^ ]/ {split($$1, name, "=="); copy = name[1] in wanted} copy' \
	  requirements/vehicle.in requirements/run.lock > requirements/vehicle.lock

vehicle: requirements/vehicle.lock   ## environment for the vehicle's computer in $(VEHICLE): `autopilot` alone
	$(PYTHON) -m venv --without-pip $(VEHICLE)
	$(PYTHON) -m pip --python $(VEHICLE) $(INSTALL) --require-hashes --no-deps --no-compile -r $<
	$(PYTHON) -m pip --python $(VEHICLE) $(INSTALL) --no-deps --no-compile .

clean:                               ## remove the virtual environment and $(OUT)
	rm -rf $(VENV) $(OUT)

$(VENV)/bin/python:
	$(PYTHON) -c 'import sys; sys.exit("Caribou needs Python >= 3.11, this is " + sys.version.split()[0]) if sys.version_info < (3, 11) else None'
	$(PYTHON) -m venv $(VENV)

$(VENV)/run.stamp: requirements/run.lock pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip $(INSTALL) --require-hashes -r requirements/run.lock
	$(BIN)/python -m pip $(INSTALL) --no-deps -e .
	-$(BIN)/python -m ground.compile_kernels
	touch $@

$(VENV)/dev.stamp: requirements/dev.lock requirements/clients.lock $(VENV)/run.stamp
	$(BIN)/python -m pip $(INSTALL) --require-hashes -r requirements/dev.lock
	$(BIN)/python -m pip $(INSTALL) --require-hashes --no-deps -r requirements/clients.lock
	touch $@
