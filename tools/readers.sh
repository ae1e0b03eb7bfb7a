#!/bin/sh
# What we write before programs that nobody here wrote, each in an environment of its own: they want other numpys.
#   readers.sh install   only the environments: .venv-bpy, .venv-lightusd, tools/readers/node_modules
#   readers.sh           those, a tree from a photo that grows, and all tests that ask them
# A reader that cannot be had is skipped, and said so; its tests then skip with a reason.
set -eu
cd "$(dirname "$0")/.."
PYTHON="${PYTHON:-python3}"
OUT="${OUT:-out}"

# environment NAME PACKAGE...: a Python that imports NAME, or none.
environment() {
    name=$1 home=".venv-$1"
    shift
    if "$home/bin/python" -c "import $name" 2>/dev/null; then return; fi
    rm -rf "$home"
    log=$(mktemp)
    if "$PYTHON" -m venv "$home" && "$home/bin/pip" install -q --disable-pip-version-check --retries 1 --timeout 20 "$@" \
        >"$log" 2>&1 && "$home/bin/python" -c "import $name" >>"$log" 2>&1
    then echo "readers: $name is there"
    else
        rm -rf "$home"
        echo "readers: $name skipped: no $* for $("$PYTHON" --version): $(tail -n 1 "$log")"
    fi
    rm -f "$log"
}

environment bpy bpy==4.5.15
environment lightusd lightusd==1.0.0rc4 tinyusdz==0.9.4 "numpy<3"
sh tools/readers/web.sh install
[ "${1:-}" != install ] || exit 0

tree="$OUT/growing/trees/cherry_pink"
.venv/bin/forestgen build scenes/growing/scene.toml -o "$OUT/growing" --quiet
.venv/bin/forestgen grow "$tree" --frames 180 --fps 24 --no-film --quiet
FORESTGEN_OUT="$OUT/growing" .venv/bin/pytest -q tests/readers
