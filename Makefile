# Penumbra. `make demo` runs the main job, `make test` the tests. Needs GNU make, a POSIX sh, git and Python 3.11, 3.12 or 3.13.
# `UV_PYTHON=3.12 make demo` picks one of several Pythons; `make test ARGS="tests/renderer -k film"` passes arguments to pytest.

SHELL := /bin/sh
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help demo test test-fast test-all check env env-dev system-parts clean

export UV_PROJECT_ENVIRONMENT := .venv
unexport VIRTUAL_ENV
# Without bytecode each process that a test starts compiles NumPy and SciPy anew: half the time of a start.
unexport PYTHONDONTWRITEBYTECODE

# uv from the PATH where it can read our lock file, else one of our own.
UV_VERSION := 0.13.9
UV := $(shell uv export --frozen --offline --quiet >/dev/null 2>&1 && command -v uv || echo .tools/uv/bin/uv)
BIN := .venv/bin

help:
	@echo 'make demo      run the main job; its last line is the path of the report'
	@echo 'make test      run the tests (as root, installs chromium and OpenGL with apt if they are missing)'
	@echo 'make test-fast the tests that need no Mitsuba, process, browser, OpenGL or many samples: about a minute'
	@echo 'make test-all  all of them with the slow tests'
	@echo 'make check     formatting, lint, types and the direction of imports'
	@echo 'make clean     remove the environment and caches; runs/ stays'

demo: env
	@$(BIN)/penumbra demo

# Two workers share the tests and one folder of references.
PYTEST := $(BIN)/python -m pytest -n 2 --dist worksteal

test: system-parts
	$(PYTEST) $(ARGS)

test-fast: env-dev
	PENUMBRA_FAST=1 $(PYTEST) $(ARGS)

test-all: system-parts
	PENUMBRA_SLOW=1 $(PYTEST) $(ARGS)

check: env-dev
	$(UV) lock --check --quiet
	$(BIN)/ruff format --check
	$(BIN)/ruff check
	$(BIN)/pyright
	$(BIN)/lint-imports --no-logo

system-parts: env-dev
	@$(SYSTEM_PARTS) test

# The environment: what the program needs, and with the tools of `make test` and `make check` on top.
env: .venv/.synced
env-dev: .venv/.synced-dev

.venv/.synced: pyproject.toml uv.lock | $(UV)
	@{ $(SYSTEM_PARTS) run && $(UV) sync --frozen --inexact --no-dev --extra all; } || { $(PYTHON_HINT) }
	@touch $@

.venv/.synced-dev: pyproject.toml uv.lock | $(UV)
	@{ $(SYSTEM_PARTS) dev && $(UV) sync --frozen --extra all; } || { $(PYTHON_HINT) }
	@touch .venv/.synced $@

SYSTEM_PARTS = $(UV) run --quiet --no-project python tests/system_parts.py
PYTHON_HINT = $(UV) python find --quiet >/dev/null 2>&1 || echo "Penumbra needs Python 3.11, 3.12 or 3.13; \
this machine offers $$(python3 --version 2>&1). Install one of them (UV_PYTHON=/path/to/python3.12 names it)." >&2; exit 1;

# A private venv works where the system Python is externally managed; where Python came without venv, `pip --target` may.
.tools/uv/bin/uv:
	@command -v python3 >/dev/null || { echo "python3 is missing: install Python 3.11, 3.12 or 3.13." >&2; exit 1; }
	@echo "No usable uv on the PATH: installing uv $(UV_VERSION) into .tools/uv"
	@log=$$(mktemp); trap 'rm -f "$$log"' EXIT; \
	in_venv() { rm -rf .tools/uv; python3 -m venv .tools/uv && .tools/uv/bin/python -m pip install --quiet uv==$(UV_VERSION); }; \
	in_target() { rm -rf .tools/uv; python3 -m pip install --quiet --target .tools/uv uv==$(UV_VERSION); }; \
	from_apt() { test "$$(id -u)" = 0 && command -v apt-get && apt-get update && apt-get install -y python3-venv; }; \
	in_venv >"$$log" 2>&1 || in_target >>"$$log" 2>&1 || { from_apt >>"$$log" 2>&1 && in_venv >>"$$log" 2>&1; } || { \
	  cat "$$log" >&2; rm -rf .tools/uv; \
	  echo "uv could not be installed. Either python3 lacks the venv module (on Debian and Ubuntu: sudo apt-get install python3-venv)," >&2; \
	  echo "or PyPI cannot be reached from here. Or put uv on the PATH yourself and run make again." >&2; exit 1; }

clean:
	rm -rf .venv .tools .pytest_cache .ruff_cache .hypothesis .import_linter_cache
