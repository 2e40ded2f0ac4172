# make flip    install and run the main job: plan, simulate four controllers, figures, replay  -> out/turnover
# make test    install, and pass the tests
# make fuzz    draw hostile input for FUZZ seconds (600); what ends badly goes to tests/hostile/corpus, which the tests replay
# make lint    ruff, mypy (--strict on the snippets of README and docs) and import-linter
# make bench   speed, against the targets  -> out/bench
# make docs    the documentation as a site, with the API reference  -> out/docs
# make report  run the studies, write the report, copy its tables and pictures into README.md and docs/  -> out/report
# make clean   remove results, caches and build products; the .venv* folders stay
# make constraints   the newest versions of all that is installed  -> constraints/X.Y.txt, for this Python X.Y
# Another Python:  make test PYTHON=python3.12   (a name or a path)
#
# Lint is no part of `make test`: a user wants to know whether the package works here, whatever a checker thinks of the
# types that a library published last night.  .ci/run does both, with every Python whose versions are kept.
# constraints/X.Y.txt holds the versions that the tests passed with, so that a fresh install of next year gets what was
# tested.  A Python without such a file, or an index without one of those versions, gets the newest that pyproject.toml allows.

PYTHON ?= python3
OUT ?= out
FUZZ ?= 600

# .venv belongs to the first Python that made it; any other version gets a folder of its own, .venv-X.Y
version := $(shell '$(PYTHON)' -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null)
venv_version := $(shell .venv/bin/python -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null)
VENV := $(if $(filter-out $(version),$(venv_version)),.venv-$(version),.venv)
RUN := $(VENV)/bin/python
INSTALLED := $(VENV)/.installed
TESTABLE := $(VENV)/.installed-test
BENCHABLE := $(VENV)/.installed-bench
DOCUMENTABLE := $(VENV)/.installed-docs

CONSTRAINTS := $(wildcard constraints/$(version).txt)

# $(call install,[EXTRAS]): this package, editable, with the tested versions where they can be had.
pip_install = $(RUN) -m pip install --quiet
install = $(if $(CONSTRAINTS),$(pip_install) --constraint $(CONSTRAINTS) --editable '.$(1)' \
	  || { echo "cannot install the versions in $(CONSTRAINTS); taking the newest" >&2; $(pip_install) --editable '.$(1)'; }, \
	  $(pip_install) --editable '.$(1)')

.PHONY: flip test fuzz lint bench docs report clean constraints python programs
.DELETE_ON_ERROR:

flip: $(INSTALLED)
	$(RUN) -m flipdiagram flip --out $(OUT)/turnover

test: $(TESTABLE) programs
	$(RUN) -m pytest -n 2 --dist loadfile --no-loadscope-reorder  # a file's tests share what is costly

fuzz: $(TESTABLE)
	$(RUN) tests/hostile/fuzz.py $(FUZZ)

lint: $(TESTABLE)
	$(RUN) -m ruff check .
	$(RUN) -m ruff format --check .
	$(RUN) -m mypy
	$(RUN) tests/strict_snippets.py
	$(VENV)/bin/lint-imports

bench: $(BENCHABLE)
	$(RUN) bench/run.py --out $(OUT)/bench

docs: $(DOCUMENTABLE)
	rm -rf $(OUT)/docs
	$(RUN) docs/build.py --out $(OUT)/docs

report: $(TESTABLE)
	$(RUN) -m flipdiagram report --out $(OUT)/report
	$(RUN) docs/publish.py $(OUT)/report

clean:
	rm -rf out build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis .grimp_cache .import_linter_cache *.egg-info
	find flipdiagram tests -name __pycache__ -type d -prune -exec rm -rf {} +

constraints: python
	$(pip_install) --upgrade --upgrade-strategy eager --editable '.[test]'
	@mkdir -p $@
	{ echo "# make constraints PYTHON=python$(version); then make lint test, and commit"; \
	  $(RUN) -m pip freeze --exclude-editable; } > $@/$(version).txt

$(INSTALLED): pyproject.toml $(CONSTRAINTS) | python
	$(call install)
	@touch $@

$(TESTABLE): pyproject.toml $(CONSTRAINTS) | python
	$(call install,[test])
	@touch $@ $(INSTALLED)

$(DOCUMENTABLE): pyproject.toml $(CONSTRAINTS) | python
	$(call install,[docs])
	@touch $@ $(INSTALLED)

$(BENCHABLE): pyproject.toml $(CONSTRAINTS) | python
	$(call install,[bench])
	@$(RUN) -m pip install --quiet --editable '.[bench-peers]' \
	  || echo "could not install all simulators to compare with; make bench names those that are missing" >&2
	@touch $@ $(INSTALLED)

# The virtual environment, or one sentence that says what is missing.
python:
	@[ -n '$(version)' ] || { echo "make: cannot run PYTHON=$(PYTHON); install Python 3.11 or newer," \
	  "or name one: make PYTHON=python3.12" >&2; exit 1; }
	@'$(PYTHON)' -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "make: $(PYTHON) is Python $(version);" \
	  "3.11 or newer is needed: make PYTHON=python3.12" >&2; exit 1; }
	@if ! $(RUN) -m pip --version >/dev/null 2>&1; then \
	  '$(PYTHON)' -c 'import ensurepip, venv' 2>/dev/null || { echo "make: $(PYTHON) cannot make a virtual environment" \
	    "(no ensurepip); on Debian and Ubuntu: apt-get install python$(version)-venv" >&2; exit 1; }; \
	  echo "making $(VENV) with Python $(version)"; \
	  '$(PYTHON)' -m venv --clear $(VENV); \
	fi

# What tests of single features need: graphviz's dot draws diagrams, chromium opens the replay, Mesa renders snapshots,
# zsh and fish complete the command line.
programs:
	@missing=; \
	for shell in zsh fish; do command -v $$shell >/dev/null || missing="$$missing $$shell"; done; \
	command -v dot >/dev/null || missing="$$missing graphviz"; \
	command -v chromium >/dev/null || command -v chromium-browser >/dev/null || command -v google-chrome >/dev/null \
	  || missing="$$missing chromium"; \
	ls /usr/lib/*/libEGL_mesa.so.0 /usr/lib*/libEGL_mesa.so.0 2>/dev/null | grep -q . \
	  || missing="$$missing libegl1 libegl-mesa0 libgl1-mesa-dri"; \
	[ -n "$$missing" ] || exit 0; \
	if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	  echo "installing for the tests:$$missing"; \
	  export DEBIAN_FRONTEND=noninteractive; \
	  apt-get update -qq >/dev/null 2>&1; \
	  apt-get install -y -qq --no-install-recommends $$missing >/dev/null 2>&1 \
	    || echo "could not install:$$missing; the tests that need them are skipped" >&2; \
	else \
	  echo "not installed, and only root with apt could do it here:$$missing; the tests that need them are skipped" >&2; \
	fi
