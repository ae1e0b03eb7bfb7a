# make demo    build the sample scenes         make test    run the tests
# make setup   only the environment (.venv)    make lint    ruff and mypy
# make bench   every benchmark                  make readers what we write in Blender, lightusd, three.js ...
PYTHON ?= python3
BIN := .venv/bin
OUT ?= out

.PHONY: demo test setup lint bench readers strangers clean

SCENES := street woods garden

demo: .setup-stamp
	@worst=0; for scene in $(SCENES); do \
		$(BIN)/forestgen build scenes/$$scene/scene.toml -o $(OUT)/$$scene >/dev/null; code=$$?; \
		[ $$code -le 1 ] || exit $$code; [ $$code -eq 0 ] || worst=1; \
	done; \
	$(BIN)/forestgen summary $(addprefix $(OUT)/,$(SCENES)); \
	exit $$worst

test: .setup-stamp
	$(BIN)/pytest -q -n auto --maxprocesses 4 --dist loadfile

lint: .setup-stamp
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: .setup-stamp
	@for file in benchmarks/*.py; do echo "== $$file"; PYTHONPATH=. $(BIN)/python $$file || exit 1; done

readers: .setup-stamp
	PYTHON="$(PYTHON)" OUT="$(OUT)" sh tools/readers.sh

# Only the readers' environments: the tests that ask them run with the others then.
strangers:
	PYTHON="$(PYTHON)" sh tools/readers.sh install

setup: .setup-stamp

.setup-stamp: pyproject.toml constraints.txt tools/setup.sh
	PYTHON="$(PYTHON)" sh tools/setup.sh
	@touch $@

clean:
	rm -rf .venv .venv-* .setup-stamp $(OUT)
