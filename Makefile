# The interpreter that makes .venv; any of Python 3.11 to 3.13.
PYTHON ?= python3
# Where the main job writes; name an earlier folder to go on with it.
OUT ?= results/quick-$(shell date +%Y%m%d-%H%M%S)
# How long work is killed and goes on.
SOAK_MINUTES ?= 60

BIN := .venv/bin
INSTALL := $(BIN)/python -m pip install --disable-pip-version-check --no-compile -c constraints.txt

# Packages are installed without, and compiled as they are imported: once, where the environment would have each process do it.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help run test kernels lint docs soak clean

help:  ## list the targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / { printf "make %-6s %s\n", $$1, $$2 }' Makefile

run: .venv/run.stamp  ## set up once, then evaluate every policy on the quick suite into results/
	$(BIN)/bug-gym evaluate --suite quick --workers 2 --out $(OUT)

test: .venv/test.stamp  ## set up once, then lint and test
	@$(MAKE) --no-print-directory -j 2 lint kernels
	$(BIN)/python -m pytest -n 2 --dist worksteal

kernels: .venv/test.stamp
	# One process compiles the kernels first: several that do so together can spoil numba's cache.
	$(BIN)/bug-gym evaluate --suite smoke > /dev/null

lint: .venv/test.stamp  ## ruff and mypy --strict
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

docs: .venv/docs.stamp  ## set up once, then build the site into docs/_build/html and follow its links
	$(BIN)/python docs/make_site.py

soak: .venv/test.stamp  ## an hour of work with random kills; its figures go to docs/results
	$(BIN)/python tests/soak.py --minutes $(SOAK_MINUTES) --out docs/results/soak.json; \
	held=$$?; $(BIN)/python docs/make_results.py && exit $$held

clean:  ## remove .venv, caches and build products; results stay
	rm -rf .venv .mypy_cache .pytest_cache .ruff_cache build dist docs/_build *.egg-info
	find agents bug_gym tests -name __pycache__ -type d -prune -exec rm -rf {} +

.venv/run.stamp: pyproject.toml constraints.txt | $(BIN)/python
	$(INSTALL) -e '.[play,render,report]'
	touch $@

.venv/test.stamp: pyproject.toml constraints.txt | $(BIN)/python
	$(INSTALL) -e '.[dev,render,report,play,train,data,hub,cluster,sweep]'
	touch $@

.venv/docs.stamp: pyproject.toml constraints.txt | $(BIN)/python
	$(INSTALL) -e '.[docs,render,report,play,train,data]'
	touch $@

$(BIN)/python:
	$(PYTHON) -m venv .venv
