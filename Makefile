# One target per intention. The presets (CMakePresets.json) do the work; this file only names it.
.DEFAULT_GOAL := help
.SUFFIXES:
SHELL := /bin/bash
jobs := $(shell nproc)
prefix ?= /usr/local

# build_preset(name): configure and build build/<name>
build_preset = cmake --preset $(1) && cmake --build --preset $(1) -j $(jobs)

.PHONY: help
help:  ## show this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-10s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

.PHONY: demo
demo: build  ## simulate a scan of an open book, measure it, flatten both pages, evaluate; report in out/demo
	scripts/demo

.PHONY: test
test: build  ## build and run every test
	ctest --preset release -j $(jobs)

.PHONY: build
build: setup  ## build build/release/pagesweep
	$(call build_preset,release)

.PHONY: setup
setup:  ## install the Debian packages that are missing
	scripts/install-dependencies

.PHONY: dev
dev: setup  ## build and test with assertions on and warnings as errors
	$(call build_preset,dev)
	ctest --preset dev -j $(jobs)

.PHONY: asan
asan: setup  ## build and test with the address and undefined behaviour sanitizers
	$(call build_preset,asan-ubsan)
	ctest --preset asan-ubsan -j $(jobs)

.PHONY: tsan
tsan: setup  ## build and test with the thread sanitizer
	$(call build_preset,tsan)
	ctest --preset tsan -j $(jobs)

.PHONY: tools
tools:
	scripts/install-dependencies --tools

.PHONY: tidy
tidy: setup tools  ## run clang-tidy on every file
	$(call build_preset,tidy)

.PHONY: format
format: tools  ## format every source file
	find src cli bench tests samples -name '*.h' -o -name '*.cc' | xargs clang-format-19 -i

.PHONY: results
results: build  ## measure every figure of docs/results.md; table and build/results/results.json
	cmake --preset bench && cmake --build --preset bench -j $(jobs) --target timing_bench
	scripts/results

.PHONY: bench
bench: setup  ## measure how long everything takes; table and build/bench/results.json
	$(call build_preset,bench)
	scripts/bench

.PHONY: docs
docs: build  ## write docs/options.md anew from the program's own help
	scripts/document-options build/release/pagesweep

.PHONY: install
install: build  ## install program, library and headers below prefix=/usr/local
	cmake --install build/release --prefix $(prefix)

.PHONY: clean
clean:  ## remove everything that was built or written: build/ and out/
	rm -rf build out
