# Everything happens in the virtual environment $(VENV); it is made, and filled anew when pyproject.toml has changed, as needed.
# Another interpreter: make PYTHON=python3.13 front. Another place: make VENV=/somewhere front.

PYTHON ?= python3
VENV ?= .venv
FIRST_RUN ?= runs/first
WORKERS ?= 2
BASELINE ?= runs/speed
REPEAT ?= 5

BIN = $(VENV)/bin
PIP = $(BIN)/python -m pip --disable-pip-version-check
INSTALL = $(PIP) install --quiet --prefer-binary
# A file stays on one worker, so what its tests share is computed once.
PYTEST = $(BIN)/python -m pytest -n $(WORKERS) --dist loadfile
METHODS ?= runs/methods.jsonl

.NOTPARALLEL:
.DELETE_ON_ERROR:
.PHONY: help front test test-slow test-browser kill resume-kill fuzz fuzz-clearance interrupts bench bench-quick bench-page bench-toppra bench-ruckig bench-guo bench-fronts bench-collocation bench-clearance bench-sizes bench-scenes bench-speed bench-arms bench-workers bench-methods coverage docs lint clean

help:
	@echo "make front      install, trace a first Pareto front into $(FIRST_RUN)"
	@echo "make test       install with the test tools, run the default tests"
	@echo "make test-slow  the slow tests"
	@echo "make test-browser the page of ocp-traj report in Chromium; skipped tests are named where there is none"
	@echo "make kill       a front killed at 20 random moments: nothing finished is lost"
	@echo "make resume-kill a front killed at 10 random moments and gone on with, without workers and with two: the same bytes"
	@echo "make fuzz       2000 mutated files, and 2000 tasks: what is proved of them holds, none ends in a traceback"
	@echo "make fuzz-clearance 2000 random motions past random bodies: no proof and no violation that a scan contradicts; minutes"
	@echo "make coverage   all tests, with their coverage"
	@echo "make interrupts Ctrl-C at MOMENTS (20) random moments of every method; takes hours"
	@echo "make bench-speed times beside those of an earlier commit: benchmarks/RESULTS.md; half an hour, on a quiet machine"
	@echo "make bench-arms a random move of every arm of example-robot-data, solved and proved, or why not; half a minute"
	@echo "make bench      all tables beside what people would use instead, into benchmarks/RESULTS.md; hours, and goes on"
	@echo "                where it was stopped; a table a target: bench-toppra, -ruckig, -guo, -fronts, -collocation,"
	@echo "                -clearance, -sizes, and -scenes with SCENES=FOLDER; QUICK=1 for a small sample of it"
	@echo "make bench-quick a small sample of all of them but the scenes, into the page; five minutes on a quiet machine"
	@echo "make bench-page the page from what was measured so far"
	@echo "make bench-workers what two and four workers save, by a clock of its own; half an hour"
	@echo "make bench-methods every method on six problems, 20 s and 60 s each, into METHODS; an hour, and goes on"
	@echo "make bench-scenes SCENES=FOLDER problems of MotionBenchMaker in clutter beside OMPL and TOPP-RA; hours, and goes on"
	@echo "                where it was stopped"
	@echo "make docs       the documentation, into build/site"
	@echo "make lint       ruff, and mypy on the installed package"
	@echo "make clean      remove $(VENV), builds and caches; runs/ stays"

# --force replaces the front of an earlier `make front`, which the command refuses on its own.
front: $(VENV)/.installed
	$(BIN)/ocp-traj pareto hybrid-spline --objectives time,energy -o $(FIRST_RUN)$(if $(wildcard $(FIRST_RUN)), --force)

test: $(VENV)/.installed-dev
	$(PYTEST)

# In the order of their files: the longest have the fewest tests, and would come last.
test-slow: $(VENV)/.installed-dev
	$(PYTEST) --no-loadscope-reorder -m slow --durations=40 --durations-min=5

# In one process: they share a browser.
test-browser: $(VENV)/.installed-dev
	$(BIN)/python -m pytest -m browser -rs

kill: $(VENV)/.installed-dev
	$(BIN)/python benchmarks/kill.py

resume-kill: $(VENV)/.installed-dev
	$(BIN)/python -m benchmarks.resume_kill

fuzz: $(VENV)/.installed-dev
	$(BIN)/python -m tests.fuzz
	$(BIN)/python -m tests.task_mutations

fuzz-clearance: $(VENV)/.installed-dev
	$(BIN)/python -m tests.clearance_fuzz

coverage: $(VENV)/.installed-dev
	$(PYTEST) -m "" --cov

interrupts: $(VENV)/.installed-dev
	$(BIN)/python benchmarks/interrupts.py $(or $(MOMENTS),20)

# What is measured of the earlier commit, and its environment, stay in BASELINE.
bench-speed: $(VENV)/.installed-dev
	$(BIN)/python -m benchmarks.speed --baseline $(BASELINE) --repeat $(REPEAT) $(OPTIONS)

bench-arms: $(VENV)/.installed-dev
	$(BIN)/python -m benchmarks.arms

# Each table is measured into a file of lines, and goes on where it was stopped; FRESH=1 begins anew.
bench: bench-toppra bench-ruckig bench-guo bench-fronts bench-collocation bench-clearance bench-sizes bench-scenes

bench-quick: $(VENV)/.installed-bench
	$(BIN)/python -m benchmarks.bench all --quick $(if $(FRESH),--fresh)

bench-page: $(VENV)/.installed-bench
	$(BIN)/python -m benchmarks.bench page $(if $(QUICK),--quick)

bench-toppra bench-ruckig bench-guo bench-fronts bench-collocation bench-clearance bench-sizes: $(VENV)/.installed-bench
	$(BIN)/python -m benchmarks.bench $(@:bench-%=%) $(if $(QUICK),--quick) $(if $(FRESH),--fresh)

bench-methods: $(VENV)/.installed-dev
	$(BIN)/python -m benchmarks.methods $(METHODS) $(OPTIONS)

bench-workers: $(VENV)/.installed-dev
	$(BIN)/python -m benchmarks.workers

bench-scenes: $(VENV)/.installed-dev
ifeq ($(SCENES),)
	@echo "bench-scenes is left out: give SCENES=FOLDER, which the head of benchmarks/scenes.py describes"
else
	$(INSTALL) --editable ".[bench,plan]"
	$(BIN)/python -m benchmarks.scenes $(SCENES) $(OPTIONS)
endif

# mypy reads the package as a user gets it. `build/` would bring back modules deleted since the last build.
lint: $(VENV)/.installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	rm -rf build $(VENV)/plain
	$(INSTALL) --no-deps --target $(VENV)/plain .
	cd $(VENV)/plain && ../bin/python -m mypy --config-file "$(CURDIR)/pyproject.toml" --cache-dir ../mypy_cache -p ocp_traj

# The API pages read the package as a user gets it, with problems and solvers in it, and import nothing.
docs: $(VENV)/.installed-dev
	rm -rf build/source build/site
	mkdir -p build/source
	cp -r ocp_traj build/source
	cp -r problems solvers build/source/ocp_traj
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet

clean:
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .ruff_cache .mypy_cache .coverage .coverage.* coverage.xml htmlcov
	find ocp_traj problems solvers tests -type d -name __pycache__ -prune -exec rm -rf {} +

$(VENV)/.installed: pyproject.toml $(VENV)/.made
	@echo "Installing ocp-traj and what it needs into $(VENV): 1.2 GB on the disk, once ..."
	$(INSTALL) --editable .
	@touch $@

$(VENV)/.installed-dev: pyproject.toml $(VENV)/.made
	@echo "Installing ocp-traj, what it needs and the test tools into $(VENV): 1.9 GB on the disk, once ..."
	$(INSTALL) --editable ".[dev]"
	@touch $(VENV)/.installed $@

# crocoddyl's wheel works with the pinocchio of today, but asks for descriptions of robots of an older one.
$(VENV)/.installed-bench: pyproject.toml $(VENV)/.installed-dev
	@echo "Installing what is measured against ..."
	$(INSTALL) --editable ".[bench]"
	-$(INSTALL) --no-deps "crocoddyl==3.2.1" "libcrocoddyl==3.2.1"
	@touch $@

$(VENV)/.made:
	@command -v $(PYTHON) >/dev/null \
	  || { echo "$(PYTHON) is not there; install it (apt-get install python3 python3-venv) or name another: make PYTHON=..." >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
	  || { echo "ocp-traj needs Python 3.11 or newer; $(PYTHON) is $$($(PYTHON) -V 2>&1). Name another: make PYTHON=..." >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null \
	  || { echo "$(PYTHON) cannot make a virtual environment: it lacks ensurepip." >&2; \
	       echo "On Debian and Ubuntu: apt-get install python3-venv (or python3.X-venv for another interpreter), then again." >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	@touch $@
