# make serve   set everything up and open the dashboard
# make test    set everything up and run every test
# make lint    ruff and pyright
# make bench   speed against peers, in one run each
# make soak    the service under kills, floods, malice and for long: hours; make soak SOAK=short takes minutes
# make audit   known faults of the dependencies, where the network has the list of them
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PYTEST_ARGS ?=
SOAK ?= full

.PHONY: serve test lint bench soak audit browser clean

serve: $(VENV)/.installed
	$(BIN)/coopnav serve $(SERVE_ARGS)

# The engine's and the server's tests on all cores; those of the page need the cores themselves.
test: $(VENV)/.installed-test browser
	OPENBLAS_NUM_THREADS=1 $(BIN)/pytest -n auto --dist loadfile tests/engine tests/server $(PYTEST_ARGS)
	$(BIN)/pytest tests/browser $(PYTEST_ARGS)

lint: $(VENV)/.installed-test
	$(BIN)/ruff check engine server tests
	$(BIN)/ruff format --check engine server tests
	$(BIN)/pyright

bench: $(VENV)/.installed-test
	$(BIN)/pytest tests/benchmarks -o python_files='bench_*.py' -s

soak: $(VENV)/.installed-test
	COOPNAV_SOAK=$(SOAK) $(BIN)/pytest tests/soak -o python_files='soak_*.py' --show-capture=no $(PYTEST_ARGS)

# pip-audit in an environment of its own. Where the list of known faults does not answer for a release that is pinned (no
# network, or a mirror that has no list) this says so and is no failure; a known fault is one.
audit: $(VENV)/.installed
	@$(VENV)/audit/bin/pip-audit --version >/dev/null 2>&1 \
	  || { $(VENV)/bin/python -m venv $(VENV)/audit \
	    && $(VENV)/audit/bin/pip install --quiet --retries 1 --timeout 10 pip-audit 2>/dev/null; } \
	  || { echo "audit: NOT DONE, pip-audit cannot be installed here"; exit 0; }; \
	known="https://pypi.org/pypi/$$(sed -n 's/^fastapi==/fastapi\//p' constraints.txt)/json"; \
	if $(BIN)/python -c "import sys, urllib.request; urllib.request.urlopen(sys.argv[1], timeout=10)" "$$known" 2>/dev/null; \
	then $(VENV)/audit/bin/pip-audit --progress-spinner off --disable-pip --no-deps -r constraints.txt; \
	else echo "audit: NOT DONE, the list of known faults does not answer ($$known)"; fi

# The browser tests need a Chromium: the one named or found, else Debian's.
browser:
	@if [ -z "$$COOPNAV_CHROMIUM" ] && ! command -v chromium >/dev/null && ! command -v chromium-browser >/dev/null \
	    && ! command -v google-chrome >/dev/null; then \
	  echo "no Chromium found: installing Debian's package chromium"; \
	  if [ "$$(id -u)" = 0 ]; then SUDO=; else SUDO=sudo; fi; \
	  $$SUDO apt-get update -qq && $$SUDO apt-get install -y -qq --no-install-recommends chromium >/dev/null \
	    || { echo "install a Chromium, or name one in COOPNAV_CHROMIUM"; exit 1; }; \
	fi

$(VENV)/bin/python:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "coopnav needs Python 3.11 or newer; set PYTHON=")'
	$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: $(VENV)/bin/python pyproject.toml constraints.txt
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e .
	touch $@

$(VENV)/.installed-test: $(VENV)/.installed
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test,lint]'
	touch $@

clean:
	rm -rf $(VENV) build dist test-artifacts *.egg-info
