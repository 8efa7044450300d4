# Two commands for everybody: `make demo` and `make test`. Both set up what they need in .venv; after
# either, .venv/bin/robotrue has every command of the README, `serve` too.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
OUT ?= demo-out

.PHONY: demo test check wheels bench mutants fuzz fuzz-guided openapi postgres clean

demo: $(VENV)/.runtime
	$(BIN)/robotrue demo --out $(OUT)

test: $(VENV)/.development
	PATH="$(abspath $(BIN)):$$PATH" sh scripts/check

# The wheel in a clean environment of each Python 3.11 to 3.13 of this computer: demo and workbench.
wheels: $(VENV)/.development
	$(BIN)/python scripts/smoke_wheel.py

bench: $(VENV)/.development
	$(BIN)/python benchmarks/run.py

# Small planted faults that the tests should notice: make mutants SAMPLE=60 SEED=2 ROOMS=robot,store
mutants: $(VENV)/.development
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[mutants]"
	nice -n 15 $(BIN)/python scripts/mutants.py --sample $(or $(SAMPLE),300) --seed $(or $(SEED),1) \
	    $(if $(ROOMS),--rooms $(ROOMS))

# Whole and damaged programs by the thousand, per dialect; hours. DIALECTS=krl,rapid for some of them.
fuzz: $(VENV)/.development
	$(BIN)/python tests/fuzz/run.py --dialects "$(DIALECTS)" --keep fuzz-out

# Coverage-guided, one dialect: make fuzz-guided DIALECTS=krl SECONDS=600
fuzz-guided: $(VENV)/.development
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[fuzz]"
	$(BIN)/python tests/fuzz/guided.py $(DIALECTS) $(or $(SECONDS),600) fuzz-out/corpus/$(DIALECTS)

# The HTTP interface asked by schemathesis, EXAMPLES requests of each sort for each operation.
openapi: $(VENV)/.development
	ROBOTRUE_OPENAPI_EXAMPLES=$(or $(EXAMPLES),200) $(BIN)/python -m pytest -q tests/web/test_openapi.py

# A PostgreSQL in a temporary folder, as tests start it; prints its URL, ends with Ctrl-C.
postgres: $(VENV)/.development
	$(BIN)/python scripts/temporary_postgres.py

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt --upgrade pip

$(VENV)/.runtime: $(VENV)/bin/python pyproject.toml constraints.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[web]"
	$(BIN)/robotrue warm-up
	@touch $@

# Python compiles what the tests import; pip would compile all, most of it for nobody.
$(VENV)/.development: $(VENV)/bin/python pyproject.toml constraints.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile -c constraints.txt \
	    -e ".[test,lint,docs]"
	@touch $@

clean:
	rm -rf $(VENV) $(OUT) fuzz-out docs/_build .mypy_cache .ruff_cache .pytest_cache
