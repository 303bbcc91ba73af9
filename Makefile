# Two commands do all the set-up on a fresh Debian machine: `make demo` and `make test`.

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.PHONY: help build page demo test test-cluster screenshots soak soak-cluster dist load estimates check client reference check-deploy check-portable setup clean

# Where the MPI flavour of libhdf5 is installed too, linking would pick it silently: name the serial one.
ifneq ($(wildcard /usr/lib/*/hdf5/openmpi /usr/lib/*/hdf5/mpich),)
export HDF5_DIR ?= $(firstword $(wildcard /usr/lib/*/hdf5/serial))
endif

PACKAGES := gcc pkg-config libhdf5-dev curl jq python3-venv ca-certificates
NODE_PACKAGES := nodejs npm
TEST_PACKAGES := $(NODE_PACKAGES) chromium
CLUSTER_PACKAGES := slurm-wlm munge bindfs
VENV := .venv
TARGET := $(or $(CARGO_TARGET_DIR),target)

help:
	@echo "make demo   build, run the spiraling vortex as a job, show its errors and a picture"
	@echo "make test   build and run all tests"
	@echo "make page   the web page alone, api/page/dist"
	@echo "make screenshots  pictures of every view of the page for docs/guide"
	@echo "make test-cluster  the tests on a Slurm cluster of two nodes on this machine, which it installs"
	@echo "make build  the release binary, $(TARGET)/release/meniscus"
	@echo "make dist   an archive with the program, licences, a bill of materials and checksums"
	@echo "make check  format and lints"
	@echo "make soak   the promises by the hundred: COUNT=1000 is all, ONLY=name,name picks; counts add up over runs"
	@echo "make soak-cluster  200 jobs under random kills of service, controller and nodes, late files, and 10,000 short jobs"
	@echo "make load   how fast the service answers under load, beside what was promised"
	@echo "make estimates  what runs were estimated to take beside what they took"
	@echo "make check-portable  a build for any x86-64 agrees with that for this machine"
	@echo "make check-deploy  the files in deploy/, as far as this machine can"

# Installs what is missing, and nothing where nothing is missing.
setup:
	@deploy/setup.sh $(PACKAGES)

# The page is bundled from api/page and becomes a part of the program.
PAGE := api/page
PAGE_SOURCES := $(shell find $(PAGE)/src -type f -not -name api-types.ts) $(PAGE)/build.mjs $(PAGE)/package.json

page: $(PAGE)/dist/index.html

$(PAGE)/node_modules/ready: $(PAGE)/package.json $(PAGE)/package-lock.json
	deploy/setup.sh $(NODE_PACKAGES)
	npm ci --prefix $(PAGE) --silent --no-audit --no-fund
	touch $@

$(PAGE)/dist/index.html: $(PAGE)/node_modules/ready $(PAGE_SOURCES)
	cd $(PAGE) && node build.mjs

build: setup page
	MENISCUS_COMMIT="$$(git rev-parse --short=12 HEAD 2> /dev/null || true)" cargo build --release --locked -p meniscus-api

# The debug information stays here; the archive is the same bytes whenever the program is.
dist: build
	mkdir -p dist && objcopy --strip-debug "$(TARGET)/release/meniscus" dist/meniscus
	python3 deploy/dist.py dist/meniscus dist && rm dist/meniscus

demo: build
	deploy/demo.sh $(TARGET)/release/meniscus

# What the tests use of Python's and of Node's packages.
$(VENV)/ready: tests/python/requirements.txt tests/node/package.json | setup
	deploy/setup.sh $(TEST_PACKAGES)
	python3 -m venv $(VENV)
	$(VENV)/bin/python -m pip install --quiet --disable-pip-version-check -r tests/python/requirements.txt
	mkdir -p $(VENV)/node && cp tests/node/package.json $(VENV)/node/
	npm install --prefix $(VENV)/node --silent --no-audit --no-fund
	touch $@

# Surfaces that people have; those that no registry gives are not run, and said to be.
$(VENV)/models/ready: tests/python/models.py $(VENV)/ready
	$(VENV)/bin/python tests/python/models.py $(VENV)/models
	touch $@

# The binary under test has debug assertions, like the tests.
test: setup page $(VENV)/ready $(VENV)/models/ready
	cargo build --profile test --locked -p meniscus-api
	export MENISCUS_BIN="$(abspath $(TARGET)/debug/meniscus)" MENISCUS_PYTHON="$(abspath $(VENV)/bin/python)" \
	MENISCUS_NODE_TOOLS="$(abspath $(VENV)/node/node_modules/.bin)" MENISCUS_MODELS="$(abspath $(VENV)/models)"; \
	if cargo nextest --version > /dev/null 2>&1; then cargo nextest run --locked --workspace --no-fail-fast && cargo test --doc --locked --workspace; \
	else cargo test --locked --workspace --no-fail-fast; fi

# Two nodes of a real Slurm on loopback, with directory and ports of their own for each test; no process is left behind.
test-cluster: setup
	deploy/setup.sh $(CLUSTER_PACKAGES)
	cargo build --profile test --locked -p meniscus-api
	MENISCUS_BIN="$(abspath $(TARGET)/debug/meniscus)" cargo test --locked --test cluster -- --ignored --test-threads 2 --skip soak::

soak-cluster: setup
	deploy/setup.sh $(CLUSTER_PACKAGES)
	cargo build --profile test --locked -p meniscus-api
	MENISCUS_BIN="$(abspath $(TARGET)/debug/meniscus)" MENISCUS_LATE_FILES=1 \
	cargo test --locked --test cluster -- --ignored --test-threads 1 --nocapture soak:: files_that_come_late

# The types of the client for Python, from the document of the API.
client: $(VENV)/ready
	cargo build --profile test --locked -p meniscus-api
	MENISCUS_BIN="$(abspath $(TARGET)/debug/meniscus)" MENISCUS_PYTHON="$(abspath $(VENV)/bin/python)" MENISCUS_UPDATE=1 \
	cargo test --locked --test service the_client_for_python

# docs/reference, from what the service says of itself.
reference: $(VENV)/ready
	cargo build --profile test --locked -p meniscus-api
	MENISCUS_BIN="$(abspath $(TARGET)/debug/meniscus)" MENISCUS_PYTHON="$(abspath $(VENV)/bin/python)" MENISCUS_UPDATE=1 \
	cargo test --locked --test service the_reference_is

check:
	cargo fmt --all --check
	cargo clippy --locked --workspace --all-targets -- -D warnings

# Promises kept under faults, COUNT thousandths of their full number in this run; soak-output/totals.json has all runs.
COUNT ?= 20
soak: setup
	cargo build --profile test --locked -p meniscus-api
	MENISCUS_BIN="$(abspath $(TARGET)/debug/meniscus)" MENISCUS_SOAK=1 COUNT=$(COUNT) ONLY=$(ONLY) \
	cargo test --locked --test soak -- --nocapture

load: build
	MENISCUS_BIN="$(abspath $(TARGET)/release/meniscus)" cargo bench --locked --bench service

estimates: build
	python3 tests/python/estimates.py "$(abspath $(TARGET)/release/meniscus)"

# Where there is neither AVX2 nor fused multiplication, the same formulas run in two lanes.
check-portable: setup
	cargo build --profile test --locked -p meniscus-api
	RUSTFLAGS="-C target-cpu=x86-64" cargo build --profile test --locked -p meniscus-api --target-dir "$(TARGET)/portable"
	python3 tests/python/portable.py "$(abspath $(TARGET)/debug/meniscus)" "$(abspath $(TARGET)/portable/debug/meniscus)"

check-deploy:
	deploy/check.sh

# Pictures of every view for docs/guide.
screenshots: page $(VENV)/ready
	cargo build --profile test --locked -p meniscus-api
	MENISCUS_BIN="$(abspath $(TARGET)/debug/meniscus)" MENISCUS_NODE_TOOLS="$(abspath $(VENV)/node/node_modules/.bin)" \
	MENISCUS_PICTURES="$(abspath docs/guide/pictures)" cargo test --locked --test browser -- --ignored pictures_of_every_view

clean:
	rm -rf $(TARGET) $(VENV) $(PAGE)/dist $(PAGE)/node_modules demo-output soak-output dist
