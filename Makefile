# Each target does all the set-up it needs; see CONTRIBUTING.md.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SOURCES := Cargo.toml Cargo.lock $(shell find crates -not -path 'crates/taxel-bridge/*' -name '*.rs' -o -name Cargo.toml -o -path '*/web/*' -type f)

.PHONY: help check setup build bridge demo test slow lint format registers bench docs dist clean

help:
	@echo "make demo   play scenes on the emulated board, find contact and lift-off, leave a report"
	@echo "make test   all tests but the slow ones     make slow   the slow ones"
	@echo "make lint   format, lint, types, floors     make bench  ratios against peers, to benchmarks/results/"
	@echo "make docs   the documentation, without warnings"
	@echo "make bridge what carries a board to other computers: six minutes of a core, for those who have several"
	@echo "make build  .venv and the extension, after a change in crates/     make format  formats"
	@echo "make dist   a wheel for machines without cargo, and the source package, to dist/"

check:
	@command -v $(PYTHON) >/dev/null || { echo "taxel needs Python 3.11 or later: install it, or say make PYTHON=/path/to/python3"; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "taxel needs Python 3.11 or later, this is $$($(PYTHON) -V): say make PYTHON=/path/to/python3.11"; exit 1; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || { echo "taxel needs Python's venv: on Debian, apt install python3-venv"; exit 1; }
	@command -v cargo >/dev/null || { echo "taxel needs cargo 1.89 or later: install it from https://rustup.rs"; exit 1; }
	@command -v cc >/dev/null || { echo "taxel needs a C compiler: on Debian, apt install build-essential"; exit 1; }

$(VENV)/.installed: pyproject.toml | check
	@echo "taxel: installing what it needs into $(VENV): over a hundred packages, minutes the first time"
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check "maturin>=1.16,<2"
	@$(BIN)/python -c 'import tomllib; p = tomllib.load(open("pyproject.toml", "rb"))["project"]; e = p["optional-dependencies"]; print("\n".join(p["dependencies"] + sum((e[x] for x in ("test", "lint", "docs", "bench", "foxglove", "neo", "nir", "nwb", "cluster")), [])))' > $(VENV)/wanted.txt
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -r $(VENV)/wanted.txt
	@touch $@

$(VENV)/.built: $(VENV)/.installed $(SOURCES)
	@echo "taxel: building: minutes the first time"
	@PIP_QUIET=1 PIP_DISABLE_PIP_VERSION_CHECK=1 VIRTUAL_ENV=$(abspath $(VENV)) $(BIN)/maturin develop --release --features test-hooks
	@touch $@

# Outside the workspace: 260 crates for those only who have more than one computer.
BRIDGE := --release --manifest-path crates/taxel-bridge/Cargo.toml --target-dir target/bridge
$(VENV)/.bridge: $(VENV)/.installed $(shell find crates/taxel-bridge -type f)
	$(BIN)/maturin build $(BRIDGE) --out target/bridge/wheels
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --force-reinstall target/bridge/wheels/taxel_bridge-*.whl
	@touch $@

setup: $(VENV)/.installed
build: $(VENV)/.built
bridge: $(VENV)/.bridge

demo: build
	$(BIN)/taxel demo

test: build
	cargo test --release --workspace --quiet
	$(BIN)/python -m pytest -q -n 2 --dist loadfile -m "not slow"

slow: build dist bridge
	cargo test --release --workspace --quiet -- --ignored
	cargo check --manifest-path fuzz/Cargo.toml --quiet
	$(BIN)/python -m pytest -q -m slow

lint: build
	cargo fmt --all --check
	cargo fmt --manifest-path crates/taxel-bridge/Cargo.toml --check
	rustfmt --edition 2024 --check crates/taxel-core/src/encode/*.rs crates/taxel-core/src/learn/rivals/*.rs crates/taxel-core/src/metrics/*.rs  # the registries' macros hide them from cargo
	cargo clippy --workspace --all-targets --quiet -- -D warnings
	RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --quiet
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache
	$(BIN)/python -m pytest -q tests/test_floors.py
	$(BIN)/python -m mypy.stubtest taxel._core --allowlist tests/stubtest-allowed.txt
	$(BIN)/python tools/page_types.py

format:
	cargo fmt --all
	cargo fmt --manifest-path crates/taxel-bridge/Cargo.toml
	rustfmt --edition 2024 crates/taxel-core/src/encode/*.rs crates/taxel-core/src/learn/rivals/*.rs crates/taxel-core/src/metrics/*.rs
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

# The tables of the board's registers, from their one source.
registers: setup
	$(BIN)/python tools/registers.py

# The peers that are large, or that want an older NumPy, are installed for the benchmarks alone.
$(VENV)/.peers: $(VENV)/.installed
	$(BIN)/python -c 'import tomllib; print("\n".join(tomllib.load(open("pyproject.toml", "rb"))["project"]["optional-dependencies"]["peers"]))' > $(VENV)/peers.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -r $(VENV)/peers.txt
	@touch $@

bench: build bridge $(VENV)/.peers
	$(BIN)/taxel bench all

docs: build
	$(BIN)/sphinx-build -W --keep-going -b html docs docs/_build/html

# Zig links against the glibc of 2018 (2.28), whatever this machine has; auditwheel looks whether that is so.
$(VENV)/.dist: $(VENV)/.installed
	$(BIN)/python -c 'import tomllib; print("\n".join(tomllib.load(open("pyproject.toml", "rb"))["project"]["optional-dependencies"]["dist"]))' > $(VENV)/dist.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -r $(VENV)/dist.txt
	@touch $@

dist: $(VENV)/.dist
	rm -rf dist
	$(BIN)/maturin sdist --out dist
	PATH="$(abspath $(BIN)):$$PATH" $(BIN)/maturin build --release --zig --compatibility manylinux_2_28 --out dist
	$(BIN)/auditwheel show dist/*.whl
	@ls -l dist

clean:
	rm -rf target $(VENV) docs/_build dist
