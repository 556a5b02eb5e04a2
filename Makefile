# Everything sets itself up: a virtual environment with pinned packages, then the work.
# Needs Python >= 3.11 and make; PYTHON names another interpreter.

PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
OUT    ?= campaign
SEED   ?= 1
# FORCE=1 replaces the campaign that $(OUT) holds; without it `ground campaign` refuses
FORCE  ?=

.PHONY: campaign test clients verify study flights check lock clean

campaign: $(VENV)/run.stamp          ## fly, identify, redesign, fly again; report in $(OUT)/report.html
	$(BIN)/ground campaign --seed $(SEED) --out $(OUT) $(if $(FORCE),--force)

test: $(VENV)/dev.stamp check        ## every check and test
	$(BIN)/python -m pytest -n 2 --dist loadfile $(PYTEST)

clients: $(VENV)/dev.stamp           ## MAVSDK and MAVProxy down their whole lists on every link and speed: pass counts
	$(BIN)/python -m tests.clients

verify: $(VENV)/dev.stamp            ## every check-case of the physics: figure, reference, tolerance
	$(BIN)/python -m tests.reference

study: $(VENV)/dev.stamp             ## what identification achieves: 200 campaigns a cell, which takes hours
	$(BIN)/python -m benchmarks.identification $(STUDY)

flights: $(VENV)/dev.stamp           ## what redesigned gains achieve in the water, beside the paper's: an hour or so
	$(BIN)/python -m benchmarks.redesign $(FLIGHTS)

check: $(VENV)/dev.stamp
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

lock:                                ## renew the pinned versions (needs pip-tools)
	pip-compile -q --strip-extras --no-header --annotation-style=line --no-emit-index-url --no-emit-find-links \
	  --no-emit-trusted-host -o requirements/run.lock pyproject.toml
	pip-compile -q --extra dev --strip-extras --no-header --annotation-style=line --no-emit-index-url \
	  --no-emit-find-links --no-emit-trusted-host -o requirements/dev.lock pyproject.toml

clean:
	rm -rf $(VENV) $(OUT)

$(VENV)/bin/python:
	$(PYTHON) -c 'import sys; sys.exit("Caribou needs Python >= 3.11, this is " + sys.version.split()[0]) if sys.version_info < (3, 11) else None'
	$(PYTHON) -m venv $(VENV)

$(VENV)/run.stamp: requirements/run.lock pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install -q --disable-pip-version-check -r requirements/run.lock
	$(BIN)/python -m pip install -q --disable-pip-version-check --no-deps -e .
	touch $@

$(VENV)/dev.stamp: requirements/dev.lock requirements/clients.lock $(VENV)/run.stamp
	$(BIN)/python -m pip install -q --disable-pip-version-check -r requirements/dev.lock
	$(BIN)/python -m pip install -q --disable-pip-version-check --no-deps -r requirements/clients.lock
	touch $@
