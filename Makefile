# The commands of the project. `make demo` and `make test` need only Python >= 3.11 and make.

VENV := .venv
BIN := $(VENV)/bin
UV ?= uv
# Extra arguments for the program, such as make demo ARGS="--keep"
ARGS ?=
PYTHON ?= $(shell for p in python3.11 python3.12 python3.13 python3.14 python3 python; do \
	if "$$p" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1; then echo "$$p"; break; fi; done)

# The lock files are complete: --no-deps keeps pip from looking for newer versions of what an extra asks for.
PIP_INSTALL = $(BIN)/python -m pip install --quiet --disable-pip-version-check
EDITABLE = $(PIP_INSTALL) --no-build-isolation --no-deps --editable . --editable clients/python
UV_COMPILE = $(UV) pip compile --quiet --universal --python-version 3.11 --generate-hashes --no-annotate \
	--no-emit-index-url --no-emit-find-links --custom-compile-command "make lock"

# Modules are compiled once for all test processes, even where the environment turns bytecode files off.
PYTEST = PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest --numprocesses auto --dist worksteal

.DEFAULT_GOAL := help
.PHONY: help demo serve test test-unit coverage kernels lint bench bench-check bench-library bench-paper bench-robust bench-levels bench-maps bench-scale bench-reliability docs screenshots ui client-types lock clean
.DELETE_ON_ERROR:

help: ## print the commands
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | awk -F ':.*## ' '{ printf "  make %-18s %s\n", $$1, $$2 }'

demo: $(VENV)/runtime.stamp ## recognise places in two real forests over HTTP and print how well it went
	@$(BIN)/urquhart demo $(ARGS)

serve: $(VENV)/runtime.stamp ## start the service on 127.0.0.1:8420
	@$(BIN)/urquhart serve $(ARGS)

test: kernels ## run every test
	@$(PYTEST) $(ARGS)

test-unit: kernels ## run the tests of the method alone, in less than a minute
	@$(PYTEST) -m unit tests/urquhart $(wildcard tests/test_*.py) $(ARGS)

coverage: kernels ## run every test and print which lines none of them reaches; takes a third longer
	@$(PYTEST) --cov --cov-report=term $(ARGS)

# Compiled beforehand, because test processes that start at the same time would each compile them.
kernels: $(VENV)/dev.stamp ## compile the kernels (once)
	@$(BIN)/urquhart warm
	@$(BIN)/python -m benchmarks.warm

lint: $(VENV)/dev.stamp ## check format, style and types
	@$(BIN)/ruff format --check .
	@$(BIN)/ruff check .
	@$(BIN)/mypy

bench: $(VENV)/dev.stamp ## measure the service beside an older commit (12 minutes): queries, writes, start, memory, size
	@$(BIN)/python -m benchmarks.service $(ARGS)

bench-check: $(VENV)/dev.stamp ## fail if an operation takes 1.3 times the work of the last release
	@$(BIN)/python -m benchmarks.service --check

bench-library: $(VENV)/dev.stamp ## measure describe, query and ingest in the library
	@$(BIN)/python -m benchmarks $(ARGS)

bench-paper: $(VENV)/dev.stamp ## rerun the paper's experiments: tables, plots, docs/results.md
	@$(BIN)/python -m benchmarks.paper $(ARGS)

bench-robust: $(VENV)/dev.stamp ## measure the default method: noise, plantations, real trees, its confidence
	@$(BIN)/python -m benchmarks.robust $(ARGS)

bench-levels: $(VENV)/dev.stamp ## measure what each level of the search adds in right answers and costs in time
	@$(BIN)/python -m benchmarks.levels $(ARGS)

bench-maps: $(VENV)/dev.stamp ## measure maps: drift, false loops, plantations, the paper's Table II: docs/maps.md
	@$(BIN)/python -m benchmarks.maps $(ARGS)

bench-scale: $(VENV)/dev.stamp ## measure up to 100,000 submaps; ARGS="--max-n 1000000" for a million
	@$(BIN)/python -m benchmarks.scale $(ARGS)

bench-reliability: $(VENV)/dev.stamp ## test the service under load, attacks and crashes: docs/reliability.md
	@$(BIN)/python -m benchmarks.reliability $(ARGS)

docs: $(VENV)/docs.stamp ## make the pages of the documentation in build/docs/site, to be read in a browser
	@$(BIN)/python website/pages.py
	@$(BIN)/zensical build --strict --clean
	@echo "open build/docs/site/index.html; with its search: python3 -m http.server --directory build/docs/site"

screenshots: $(VENV)/dev.stamp node_modules/.package-lock.json ## take the pictures of the console for the documentation again (needs node and Chromium)
	@$(BIN)/python website/screenshots.py

ui: node_modules/.package-lock.json ## build the console into server/console/assets (needs node)
	@npm run --silent --workspace ui check
	@npm run --silent --workspace ui build

client-types: $(VENV)/runtime.stamp node_modules/.package-lock.json ## write the types of the TypeScript client again (needs node)
	@$(BIN)/urquhart reference --openapi | node clients/typescript/generate.mjs

node_modules/.package-lock.json: package-lock.json
	@npm ci --silent

# The service makes maps. GTSAM's wheel names pytest as a requirement, which it does not use.
lock: ## resolve the lock files again (needs uv)
	@$(UV_COMPILE) pyproject.toml --extra maps --output-file requirements.lock \
		$(addprefix --no-emit-package ,pytest iniconfig pluggy)
	@$(UV_COMPILE) --group build --constraint requirements.lock --output-file requirements-build.lock
	@$(UV_COMPILE) pyproject.toml --extra dev --group build --constraint requirements.lock --output-file requirements-dev.lock
	@$(UV_COMPILE) --group docs --constraint requirements-dev.lock --output-file requirements-docs.lock

clean: ## remove everything that the other commands created
	@rm -rf $(VENV) build dist demo-output benchmark-output .coverage htmlcov .mypy_cache .pytest_cache .ruff_cache .hypothesis
	@find . -name __pycache__ -type d -prune -exec rm -rf {} +

# The environment: created once, and filled from the lock files (hashes are checked) whenever they change.
$(BIN)/pip:
	@test -n "$(PYTHON)" || { echo "make: Python 3.11 or newer is needed and was not found: install it, or name it with make PYTHON=/path/to/python" >&2; exit 1; }
	@echo "creating $(VENV) with $(PYTHON) (about 5 s, once)"
	@$(PYTHON) -m venv --clear $(VENV)

$(VENV)/runtime.stamp: requirements.lock requirements-build.lock pyproject.toml clients/python/pyproject.toml | $(BIN)/pip
	@echo "installing the service and $$(grep -c == requirements.lock) pinned packages into $(VENV) (about 20 s, once)"
	@$(PIP_INSTALL) --no-deps --require-hashes --requirement requirements.lock --requirement requirements-build.lock
	@$(EDITABLE)
	@touch $@

$(VENV)/docs.stamp: requirements-docs.lock | $(BIN)/pip
	@echo "installing what makes the pages of the documentation into $(VENV) (about 10 s, once)"
	@$(PIP_INSTALL) --no-deps --require-hashes --requirement requirements-docs.lock
	@touch $@

$(VENV)/dev.stamp: requirements-dev.lock pyproject.toml clients/python/pyproject.toml | $(BIN)/pip
	@echo "installing the tests' $$(grep -c == requirements-dev.lock) pinned packages into $(VENV) (about 30 s, once)"
	@$(PIP_INSTALL) --no-deps --require-hashes --requirement requirements-dev.lock
	@$(EDITABLE)
	@touch $@
