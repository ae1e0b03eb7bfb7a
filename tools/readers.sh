#!/bin/sh
# A growing tree before programs that nobody here wrote. Each has an environment of its own: they want other numpys.
set -eu
cd "$(dirname "$0")/.."
PYTHON="${PYTHON:-python3}"
OUT="${OUT:-out}"
tree="$OUT/growing/trees/cherry_pink"

.venv/bin/forestgen build scenes/growing/scene.toml -o "$OUT/growing" --quiet
.venv/bin/forestgen grow "$tree" --frames 180 --fps 24 --no-film --quiet

# reader NAME SCRIPT PACKAGE...: run a script in an environment with these packages, or say why not.
reader() {
    name=$1 script=$2
    shift 2
    home=".venv-$name"
    if [ ! -x "$home/bin/python" ] || ! "$home/bin/python" -c "import $name" 2>/dev/null; then
        "$PYTHON" -m venv "$home"
        if ! "$home/bin/pip" install -q "$@"; then
            echo "readers: $name skipped: $* could not be installed for $("$PYTHON" --version)"
            return 0
        fi
    fi
    "$home/bin/python" "tools/readers/$script" "$tree/growing.usda"
}

reader bpy blender_plays.py bpy==4.5.15
reader lightusd lightusd_plays.py lightusd==1.0.0rc4 "numpy<3"
