# make demo    build both sample scenes        make test    run the tests
# make setup   only the environment (.venv)    make lint    ruff and mypy
PYTHON ?= python3
BIN := .venv/bin
OUT ?= out

.PHONY: demo test setup lint bench clean

demo: .setup-stamp
	@$(BIN)/forestgen build scenes/street/scene.toml -o $(OUT)/street >/dev/null; a=$$?; \
	$(BIN)/forestgen build scenes/woods/scene.toml -o $(OUT)/woods >/dev/null; b=$$?; \
	[ $$a -le 1 ] && [ $$b -le 1 ] || exit $$(( a > b ? a : b )); \
	$(BIN)/forestgen summary $(OUT)/street $(OUT)/woods; \
	[ $$a -eq 0 ] && [ $$b -eq 0 ]

test: .setup-stamp
	$(BIN)/pytest -q -n auto --maxprocesses 4 --dist loadfile

lint: .setup-stamp
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: .setup-stamp
	@for file in benchmarks/*.py; do echo "== $$file"; $(BIN)/python $$file || exit 1; done

setup: .setup-stamp

.setup-stamp: pyproject.toml constraints.txt tools/setup.sh
	PYTHON="$(PYTHON)" sh tools/setup.sh
	@touch $@

clean:
	rm -rf .venv .setup-stamp $(OUT)
