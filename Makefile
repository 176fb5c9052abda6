# Two commands do everything on a fresh machine with Python >= 3.11: `make run` and `make test`.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
SOURCES := pyproject.toml README.md
REGIMES := fig-4-2a fig-4-2b fig-4-3a fig-4-3b fig-4-4
DRAWN := fig-2-6 fig-3-4 fig-3-4-nearest fig-3-5 fig-3-6 fig-3-7 fig-3-8 fig-5-3 fig-5-4 fig-5-5 fig-5-6 fig-5-7 fig-5-8 fig-5-9 \
    fig-5-10 fig-5-11 fig-a-1 fig-d-1 fig-d-2 fig-d-3 fig-d-4 fig-d-5 fig-d-6 mean-field embodiment kilobot-ranges order-change \
    random-walks random-walks-robots speed-distributions broad-speeds broad-speeds-robots wireless
STUDIED := thesis-speeds k-nearest fig-a-1 fig-5-3 fig-5-4 fig-5-5 fig-5-10 speed-distributions

COMPILED := epuck_sim/compiled
PRECOMPILED := thesis particles obstacles physical

.PHONY: run test lint docs compiled dist wasm page-types bench slow torture trials figures clean

run: $(VENV)/installed ## install, and simulate the thesis's base case
	$(BIN)/epuck-sim run thesis
	@echo; echo "What comes next:"; echo "  source $(BIN)/activate"; echo "  epuck-sim run thesis --live --web"

test: $(VENV)/test-tools ## lint, types and all tests but the slow ones, or those of one room: ROOM=particles
	@echo "lint and types; beside them, the kernels of robots and of agents are compiled, once for all tests"
	$(if $(ROOM),,$(BIN)/python -m tests.compiled robots & $(BIN)/python -m tests.compiled agents &) \
	    $(MAKE) --no-print-directory lint; found=$$?; wait; exit $$found
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -m "not slow" --ignore=tests/benchmarks --numprocesses auto --maxprocesses 4 --dist worksteal \
	    $(ROOM:%=tests/%)

lint: $(VENV)/test-tools
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache
	$(BIN)/python -m tests.weights

docs: $(VENV)/docs-tools ## build the site of the docs into site/
	$(BIN)/python -m sphinx --fail-on-warning --keep-going --fresh-env --quiet --doctree-dir site/.doctrees docs site
	@echo "site/index.html"

compiled: $(VENV)/installed ## compile the kernels for the Python at hand, to be packed with a release
	mkdir -p $(COMPILED)
	set -e; for scenario in $(PRECOMPILED); do \
	    NUMBA_CACHE_DIR=$(COMPILED) $(BIN)/epuck-sim run $$scenario --set stop.max_cycles=2 --record $(COMPILED)/trial.rrd; \
	done
	rm $(COMPILED)/trial.rrd

dist: compiled $(VENV)/dist-tools ## build sdist and wheel, compiled kernels inside, into dist/
	$(BIN)/python -m build --sdist --wheel
	rm -r $(COMPILED)

wasm: $(VENV)/wasm-tools ## make the kernels of pages anew, as WebAssembly
	$(BIN)/python -m epuck_sim.page.build

page-types: ## check the types of the pages' scripts, with npm
	npx --yes --package typescript@5 tsc -p epuck_sim/page/web

bench: $(VENV)/test-tools ## measure; figures as ratios within one run
	$(BIN)/python -m pytest -s tests/benchmarks
	$(BIN)/python -m tests.benchmarks.ratios

slow: $(VENV)/test-tools ## the science that takes minutes
	$(BIN)/python -m pytest -m slow

torture: $(VENV)/test-tools ## every command that writes, with kills and full disks, flipped bytes, far-fetched input, stand-ins for SLURM; bounded by timeout
	TORTURE=25 timeout 3600 $(BIN)/python -m pytest -m "slow or not slow" -rP -n 2 tests/sweep/test_torture.py tests/runs/test_folder.py \
	    tests/runs/test_merge.py tests/cli/test_controllers.py tests/cli/test_interrupt.py tests/util/test_machine.py \
	    tests/recording/test_rrd_file.py tests/overhead/test_film.py tests/sweep/test_run.py

trials: $(VENV)/installed ## make the tables of trials anew, on which claims and figures rest; days, but it can be stopped and goes on
	$(BIN)/python -m docs.figures.tables --run runs
	$(BIN)/epuck-sim replicate --until-decided --out runs/replication
	$(BIN)/python -m docs.trials runs/replication

figures: $(VENV)/installed ## make the figures and tables of the docs anew, from tables of trials where these take long
	$(BIN)/python -m docs.figures.tables runs
	$(BIN)/epuck-sim run thesis --seed 13 --record runs/thesis_run.rrd
	$(BIN)/epuck-sim replay runs/thesis_run.rrd --screenshot docs/figures/viewer.png --at 89
	$(BIN)/python docs/figures/animation.py
	$(BIN)/python docs/run_notebook.py docs/notebook.ipynb
	$(BIN)/python docs/figures/moving.py
	$(BIN)/python docs/figures/base_curve.py runs/thesis-speeds
	$(BIN)/python docs/figures/shipped_pictures.py
	$(BIN)/python -m docs.validation runs/validation
	$(BIN)/python -m docs.paper.make
	$(BIN)/epuck-sim fit $(REGIMES:%=runs/%) > docs/figures/scaling.txt
	$(BIN)/python docs/figures/response_curves.py
	$(BIN)/python docs/examples/learn_response.py docs/figures/learning
	$(BIN)/python docs/examples/learnt_policy.py docs/figures/policy
	$(BIN)/python docs/figures/overhead_views.py
	$(BIN)/python -m docs.figures.overhead_kinds
	$(BIN)/python -m docs.figures.overhead_identities
	set -e; for drawn in switching:order_parameter consensus:consensus consensus-robots:consensus fault-detection:false_alarms; do \
	    $(BIN)/epuck-sim plot runs/$${drawn%:*} --of $${drawn#*:} --to runs/$${drawn%:*}; \
	    cp runs/$${drawn%:*}.png runs/$${drawn%:*}.csv docs/figures/; \
	done
	$(BIN)/epuck-sim summarize runs/switching --of mean_speed --csv > docs/figures/switching.csv
	$(BIN)/epuck-sim summarize runs/fault-detection --of detection_delay --csv > docs/figures/detection-delay.csv
	$(BIN)/python docs/figures/fig_4_7.py runs/fig-4-7
	$(BIN)/python docs/figures/pushing.py runs/pushing-synchrony
	$(BIN)/python docs/figures/neighbour_change.py runs/neighbour-change
	$(BIN)/epuck-sim fit runs/v-f > docs/figures/v_f.txt
	set -e; for sweep in $(REGIMES) $(DRAWN); do \
	    $(BIN)/epuck-sim plot runs/$$sweep --to runs/$$sweep; \
	    cp runs/$$sweep.png runs/$$sweep.csv docs/figures/; \
	done
	set -e; for axis in contact.robots=true,false robots.0.signal.occlusion=true,false once_per_sighting=false,true; do \
	    $(BIN)/epuck-sim compare runs/embodiment --axis $$axis; \
	done > docs/figures/embodiment.txt
	$(BIN)/epuck-sim compare runs/wireless runs/wireless \
	    --points 15,20 --points 16,21 --points 17,22 --points 18,23 --points 19,24 > docs/figures/wireless.txt
	set -e; for sweep in random-walks broad-speeds; do $(BIN)/epuck-sim fit runs/$$sweep > docs/figures/$$sweep.txt; done
	set -e; for axis in run_s=1,10 exponent=0,2; do \
	    $(BIN)/epuck-sim compare runs/random-walks-robots --axis robots.0.parameters.$$axis; \
	done > docs/figures/random-walks-robots.txt
	$(BIN)/epuck-sim compare runs/broad-speeds-robots --axis robots.0.parameters.speed_spread=0,0.5,1 \
	    > docs/figures/broad-speeds-robots.txt
	$(BIN)/epuck-sim summarize runs/embodiment-agents --csv > docs/figures/embodiment-agents.csv
	$(BIN)/epuck-sim summarize runs/reflections --csv > docs/figures/reflections.csv
	$(BIN)/epuck-sim compare runs/reflections --axis reflection_range_cm=0,50,200 > docs/figures/reflections.txt
	$(BIN)/python docs/figures/statistics_study.py $(STUDIED:%=runs/%)

$(VENV)/created:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "epuck-sim needs Python 3.11 or newer")'
	$(PYTHON) -m venv $(VENV)
	touch $@

$(VENV)/installed: $(VENV)/created $(SOURCES)
	$(BIN)/python -m pip install --quiet --editable '.[film,plot,view]'
	touch $@

$(VENV)/test-tools: $(VENV)/installed
	$(BIN)/python -m pip install --quiet --editable '.[test]'
	touch $@

$(VENV)/dist-tools: $(VENV)/installed
	$(BIN)/python -m pip install --quiet build
	touch $@

$(VENV)/wasm-tools: $(VENV)/installed
	$(BIN)/python -m pip install --quiet --editable '.[page]'
	touch $@

$(VENV)/docs-tools: $(VENV)/installed
	$(BIN)/python -m pip install --quiet --editable '.[docs]'
	touch $@

clean:
	rm -rf $(VENV) $(COMPILED) dist site
