# make demo, make test: all set-up included, on a machine with Python 3.11 or newer. `make help` lists the rest.
#
# Packages are installed into $(VENV) with uv where it is installed, else with venv and pip, from requirements.lock.
# Variables: PYTHON (interpreter), VENV (folder), UV (empty: do without uv), ARGS (of demo and test), JOBS (tests side by
# side: as many as there are cores).

VENV ?= .venv
UV   ?= $(shell command -v uv 2>/dev/null)
ARGS ?=
JOBS ?= auto
BIN  := $(VENV)/bin
DONE := $(VENV)/.installed

# Containers often set this. Each of the many processes of a run or a test would compile all libraries again, at 2 s each.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help setup demo test bench pictures tables lock clean

help: ## list what make can do
	@sed -n 's/^\([a-z]*\):.*## /  make \1\t/p' $(firstword $(MAKEFILE_LIST)) | expand -t 18

setup: $(DONE) ## install everything into .venv

demo: $(DONE) ## track a sine on X, Y and Z in all three modes; the report is demo/report.html
	@$(BIN)/rds demo --out demo $(ARGS)

test: $(DONE) ## ruff, mypy, then the tests
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy --num-workers 2
	$(BIN)/pytest -n $(JOBS) $(ARGS)

bench: $(DONE) ## measure speed and latency, beside other programs where they are installed (minutes)
	$(BIN)/python -m benchmarks $(ARGS)

pictures: $(DONE) ## draw the documents' pictures afresh
	$(BIN)/python tests/pictures.py

tables: $(DONE) ## make docs/library.md and the JSON Schemas afresh from the program's own tables
	$(BIN)/python -m rds library --markdown > docs/library.md
	$(BIN)/python -m rds schema --out rds/cli/schemas

# The newest page of Voilà and the newest extension for its widgets that were built with one JupyterLab. With later ones
# the page is the same, and the browser's console has up to 13 warnings.
SAME_LAB := 'voila<=0.5.8' 'jupyterlab-widgets<=3.0.13'
# Later ones import pydantic to read a command's arguments, which takes each command up to a tenth of a second longer.
LIGHT := 'typer<0.29'

lock: ## renew requirements.lock from pyproject.toml (needs uv)
	@test -n "$(UV)" || { echo "make lock needs uv: https://docs.astral.sh/uv/" >&2; exit 2; }
	printf '%s\n' 'hatchling>=1.25' 'editables>=0.5' $(SAME_LAB) $(LIGHT) | "$(UV)" pip compile pyproject.toml - --all-extras --universal \
		--python-version 3.11 --generate-hashes --upgrade --quiet --no-annotate \
		--no-emit-index-url --no-emit-find-links \
		--custom-compile-command "make lock" --output-file requirements.lock

clean: ## remove the environment, caches and results of the demo
	rm -rf $(VENV) demo build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# The stamp lies inside the environment, so that it goes when the environment goes.
$(DONE): pyproject.toml requirements.lock
ifneq ($(UV),)
	@$(BIN)/python $(is_new_enough) || "$(UV)" venv --quiet --clear --python "$(or $(PYTHON),>=3.11)" $(VENV)
	@$(call new_enough,$(BIN)/python)
	"$(UV)" pip install --quiet --python $(BIN)/python --require-hashes -r requirements.lock
	"$(UV)" pip install --quiet --python $(BIN)/python --no-deps --no-build-isolation --editable .
else
	@$(make_venv)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
endif
	@touch $@

is_new_enough = -c "import sys; sys.exit(sys.version_info < (3, 11))" 2>/dev/null

define new_enough
$(1) $(is_new_enough) || { \
	echo "$(1) is `$(1) --version 2>&1`; RDS needs Python 3.11 or newer." >&2; \
	echo "Install one (python.org, your system's packages, or uv), then: make PYTHON=/path/to/python3.11 $(MAKECMDGOALS)" >&2; \
	exit 2; }
endef

# An environment without pip (made by uv, or half made) or with an old Python is made anew.
define make_venv
if ! { $(BIN)/python $(is_new_enough) && $(BIN)/python -m pip --version >/dev/null 2>&1; }; then \
	python="$(PYTHON)"; \
	for name in python3 python3.14 python3.13 python3.12 python3.11 python; do \
		if [ -z "$$python" ] && $$name $(is_new_enough); then python=$$name; fi; \
	done; \
	python=$${python:-python3}; \
	$(call new_enough,$$python); \
	echo "$$python -m venv $(VENV)"; \
	$$python -m venv --clear $(VENV) || { \
		rm -rf $(VENV); \
		echo "$$python cannot make a virtual environment with pip in it. On Debian and Ubuntu:" >&2; \
		echo "    sudo apt install python3-venv" >&2; \
		echo "or install uv (https://docs.astral.sh/uv/), which needs neither venv nor pip; then run make again." >&2; \
		exit 2; }; \
fi
endef
