PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready

# small problems: a second thread of the linear algebra costs more than it brings
export OMP_NUM_THREADS ?= 1
# hundreds of processes import the packages: each would compile them anew
export PYTHONDONTWRITEBYTECODE :=

# fast tests of the documents, which are checks
CHECKED := tests/test_readme.py tests/docs/test_plain_english.py

.PHONY: demo paper samples test check docs reference wheels clean
.DEFAULT_GOAL := test

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	touch $(READY)

demo: $(READY)
	$(BIN)/python docs/making/demo.py --out demo

# the sample reports of the site and the outputs of its notebooks: a quarter of an hour on one core
samples: $(READY)
	$(BIN)/python docs/making/samples.py
	$(BIN)/python docs/making/notebooks.py

# the paper's tables and figures, hours on two cores; both trainings go on where they were stopped
STEPS ?= 2000
paper: $(READY)
	$(BIN)/datagen run MixedAirCO2 --preset many-rooms --systems 4000 --seed 60601 --shard-size 250 --out paper/rooms
	$(BIN)/trainer benchmark paper/rooms --out paper/benchmark --steps $(STEPS) --windows 400 --seeds 3 --ours ridge \
	    --parts table3 table4 figure4 figure5 systems channels noise --workers 2 \
	    --published fmus/MixedAirCO2/published.json
	$(BIN)/datagen run MixedAirCO2 --preset paper-year --seed 515151 --out paper/year
	$(BIN)/trainer fit paper/year --out paper/by-heart --steps 49800 --keep last --resume
	$(BIN)/trainer evaluate paper/by-heart paper/year --windows 1000 --seed 5

check: $(READY)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/python -m pytest -q $(CHECKED)

docs: $(READY)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

# the pages of docs/reference that are made from the code
reference: $(READY)
	$(BIN)/python docs/making/reference.py

# the wheel in clean environments under every Python that is there (PYTHONS names others), and the steps of all images
PYTHONS ?= python3.11 python3.12 python3.13
wheels: $(READY)
	ZEROSHOT_PYTHONS="$(PYTHONS)" $(BIN)/python -m pytest -rA tests/packaging tests/docker/test_images.py

# check has run some tests already; the tests of a file stay together, so that what they share is made once,
# and tests/conftest.py has the longest files first. Three processes on two cores: farms and installations are waited for
test: check
	$(BIN)/python -m pytest -n 3 --dist loadfile --no-loadscope-reorder $(CHECKED:%=--ignore=%)

clean:
	rm -rf demo paper .mypy_cache .ruff_cache .pytest_cache build dist *.egg-info
