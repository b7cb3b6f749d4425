# Two commands: `make demo` shows what the program does, `make test` says whether it works. Both set up .venv when it is missing.
PYTHON ?= python3
BIN := .venv/bin
export OPENBLAS_NUM_THREADS := 1
export OMP_NUM_THREADS := 1
# scripts of docs/ use datasets/rig; a comment behind the value would leave blanks at its end
export PYTHONPATH := .
unexport PYTHONDONTWRITEBYTECODE  # a set one has each of some hundred processes compile the program anew

STUDIES := configs/m2/dmsp-20-88-found.yaml configs/m2/peano-found.yaml

UPLOT := 1.6.32
comma := ,
# TypeScript checks the scripts of pages; .ci/run puts it into build/ where it is not installed.
TSC := $(firstword $(shell command -v tsc) $(wildcard build/typescript/node_modules/.bin/tsc))

# The tests of one file follow each other in one process, so that what they share is made once; the folders with the long ones come first.
TESTS := $(BIN)/pytest -q -n 2 --dist worksteal

.PHONY: release-check generated demo test test-all lint vendored schema docs datasets measured motion paper peers bench fuzz torture mutants test-lowest test-newest audit sbom constraints clean bench-id

demo: .venv/program
	$(BIN)/mapmore batch $(STUDIES)

test: lint
	$(TESTS) -m "not long"

test-all: lint  # with the studies that are of the same kind as others, and four times the examples of most properties
	$(TESTS) --hypothesis-profile=all

lint: .venv/development
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache
	$(if $(TSC),$(TSC) --noEmit --allowJs --checkJs --target es2023 --lib es2023$(comma)dom$(comma)dom.iterable tests/reporting/globals.d.ts \
	  $(filter-out %/uplot.js,$(wildcard mapmore_cli/reporting/scripts/*.js)),@echo "There is no tsc here, so the scripts of pages are not checked.")

vendored:  # uPlot (MIT) from its package, and the checksums that a test asks for; needs npm and the network
	mkdir -p build/uplot
	cd build/uplot && npm pack --silent uplot@$(UPLOT) && tar xzf uplot-$(UPLOT).tgz
	cp build/uplot/package/dist/uPlot.iife.min.js mapmore_cli/reporting/scripts/uplot.js
	cp build/uplot/package/dist/uPlot.min.css mapmore_cli/reporting/scripts/uplot.css
	cp build/uplot/package/LICENSE mapmore_cli/reporting/scripts/uplot.LICENSE
	cd mapmore_cli/reporting/scripts && sha256sum uplot.js uplot.css uplot.LICENSE > vendored.sha256

schema: .venv/program
	$(BIN)/mapmore schema > configs/experiment.schema.new && mv configs/experiment.schema.new configs/experiment.schema.json

datasets: .venv/program
	for spec in datasets/*/*.yaml; do $(BIN)/python -m datasets.rig $$spec --force || exit; done
	$(BIN)/python -m datasets.rig datasets/peano/autumn/load_cycles.yaml -o mapmore_cli/pipeline/shipped/autumn --force

generated: .venv/development  # the pages that are made from the program: commands, keys, formulas, files, Python, gallery, notebook
	$(BIN)/python docs/generated.py

docs: .venv/development  # the site, into build/site; needs no network
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet --config-file docs/site/mkdocs.yml

measured: .venv/formats  # the tables of docs/measured-static.md, memory.md, campaigns.md, damping.md, limits.md, intervals.md, wrist.md and muscle-like.md; needs the measured recordings (docs/data.md)
	$(BIN)/mapmore batch configs/campaigns/measured_static.yaml configs/campaigns/m1.yaml configs/campaigns/m1_terms.yaml
	$(BIN)/python docs/measured_tables.py runs
	$(BIN)/mapmore batch configs/campaigns/coiled.yaml configs/campaigns/coiled_other_load.yaml
	$(BIN)/python docs/memory_tables.py runs
	$(BIN)/python docs/campaign_tables.py runs
	$(BIN)/python docs/damping_tables.py runs
	$(BIN)/python docs/limits_tables.py runs
	$(BIN)/python docs/interval_tables.py runs measured bands
	$(BIN)/python docs/muscle_tables.py runs
	$(BIN)/python docs/muscle_figures.py runs

paper: .venv/formats  # every shipped study, then runs/paper.html: the papers' tables and figures beside ours; measured recordings where they are (docs/data.md)
	code=0; \
	if test -d "$${MAPMORE_DATA:-../shared/data}"; then \
	  $(BIN)/mapmore batch configs/campaigns/measured.yaml configs/campaigns/coiled_motion.yaml configs/campaigns/coiled.yaml configs/campaigns/measured_static.yaml || code=$$?; \
	else echo "left out: there are no measured recordings (docs/data.md)" >&2; fi; \
	$(BIN)/mapmore batch configs/campaigns/paper.yaml || code=$$?; \
	$(BIN)/python docs/papers/compare.py && PYTHONPATH=.:docs/papers $(BIN)/python docs/reproduce_tables.py runs && exit $$code

motion: .venv/formats  # the tables of docs/motion.md; one of them needs the measured recordings (docs/data.md)
	$(BIN)/mapmore batch configs/campaigns/motion_sections.yaml configs/campaigns/coiled_motion.yaml configs/motion/dmsp-20-400-waveforms.yaml configs/motion/dmsp-20-400-loads.yaml
	$(BIN)/python docs/motion_tables.py runs

peers: .venv/program .venv-bench/peers  # the table of docs/frols.md
	$(BIN)/python docs/frols_tables.py .venv-bench/bin/python

bench-id: .venv/formats  # the tables of docs/benchmarks.md, which need the measured recordings (docs/data.md)
	$(BIN)/python docs/benchmark_tables.py runs

bench: .venv/program .venv-bench/peers
	$(BIN)/python tests/bench/run.py $(BENCH)

FUZZ ?= 10000
fuzz: .venv/development  # what strangers may write, and result files with flipped bits: read, told, or refused; docs/reliability.md
	$(BIN)/python tests/fuzz/run.py $(FUZZ)

TORTURE ?= 100
torture: .venv/development  # commands that are killed, interrupted, out of room, not allowed to write, or two at once; docs/reliability.md
	$(BIN)/python tests/torture/torture.py $(TORTURE)

mutants: .venv/development  # a hundred small faults, each against the tests of its room (tests/mutants); at most 15 may survive
	$(BIN)/python tests/mutants/mutants.py run

LOWEST_TESTS := tests/modelling/frols tests/modelling/terms tests/modelling/scores tests/study tests/storage tests/ingestion
# it compares a text that today's pydantic writes
LOWEST_WITHOUT := tests/study/test_schema.py::test_the_checked_in_schema_is_up_to_date
test-lowest: .venv/development .venv-lowest/program  # the oldest libraries that pyproject.toml allows: tests, and the results beside those of .venv
	.venv-lowest/bin/pytest -q -o filterwarnings=default $(LOWEST_TESTS) $(LOWEST_WITHOUT:%=--deselect %)  # old libraries warn of others that are newer
	mkdir -p build
	.venv-lowest/bin/python tests/lowest/lowest.py run build/lowest.json
	$(BIN)/python tests/lowest/lowest.py run build/newest.json
	$(BIN)/python tests/lowest/lowest.py compare build/lowest.json build/newest.json

NEWEST ?=
test-newest:  # the newest Python here, or NEWEST=python3.12, with the newest libraries: the same tests, and a study of each kind
	$(PYTHON) tests/newest/newest.py "$(NEWEST)" $(LOWEST_TESTS)

audit: .venv-audit/program  # known weaknesses of the tested versions; asks an advisory service over the network
	.venv-audit/bin/pip-audit --strict --disable-pip --require-hashes -r requirements-hashed.txt

sbom: .venv-audit/program  # bill of materials (CycloneDX) of the tested versions with the hashes of their files
	mkdir -p build
	.venv-audit/bin/cyclonedx-py requirements requirements-hashed.txt --output-reproducible -o build/mapmore.cdx.json

constraints: .venv-audit/program  # after a change of constraints.txt: the same versions with the hashes of their files
	echo "# constraints.txt with the hashes of all files, for Python 3.11 and later on every system; made by \`make constraints\`." > requirements-hashed.new
	.venv-audit/bin/uv pip compile pyproject.toml --all-extras --constraint constraints.txt --python-version 3.11.0 --universal --generate-hashes \
	  --no-header --no-annotate --no-emit-index-url --quiet >> requirements-hashed.new && mv requirements-hashed.new requirements-hashed.txt

release-check: .venv/development  # archive and wheel without a network, then five visitors on 3.11, 3.12 and 3.13 where these are
	.ci/release.sh $(PYTHONS)

clean:
	rm -rf .venv .venv-lowest .venv-newest .venv-audit runs build *.egg-info

.venv/program: pyproject.toml constraints.txt
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e .
	touch $@

.venv/formats: .venv/program  # readers of all files among the measured recordings
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[formats]"
	touch $@

.venv/development: .venv/program
	$(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt -e ".[dev]"
	touch $@

.venv-bench/peers: tests/bench/peers.txt
	$(PYTHON) -m venv .venv-bench
	while read -r peer; do .venv-bench/bin/pip install --quiet --disable-pip-version-check "$$peer" || true; done < $<
	touch $@

.venv-lowest/program: pyproject.toml tests/lowest/lowest.py
	$(PYTHON) -m venv .venv-lowest
	$(PYTHON) tests/lowest/lowest.py requirements > .venv-lowest/requirements.txt
	.venv-lowest/bin/pip install --quiet --disable-pip-version-check -r .venv-lowest/requirements.txt
	.venv-lowest/bin/pip install --quiet --disable-pip-version-check --no-deps -e .
	touch $@

.venv-audit/program:
	$(PYTHON) -m venv .venv-audit
	.venv-audit/bin/pip install --quiet --disable-pip-version-check pip-audit cyclonedx-bom uv
	touch $@
