#!/bin/sh
# Leave a working .venv in the checkout: pinned packages, forestgen itself, and GL libraries for the renderer.
set -eu
cd "$(dirname "$0")/.."
PYTHON="${PYTHON:-python3}"

stop() {
    echo "setup: $*" >&2
    exit 1
}

# Run a command as root where that is possible without asking for a password.
as_root() {
    if [ "$(id -u)" = 0 ]; then "$@"
    elif command -v sudo >/dev/null 2>&1 && sudo -n true 2>/dev/null; then sudo -n "$@"
    else return 1
    fi
}

# Install Debian packages, or print the line that would and stop.
need_packages() {
    if command -v apt-get >/dev/null 2>&1 && as_root true; then
        echo "setup: installing system packages: $*"
        log=$(mktemp)
        if as_root env DEBIAN_FRONTEND=noninteractive sh -c \
            'apt-get update -qq && apt-get install -y -qq --no-install-recommends "$@"' install "$@" >"$log" 2>&1
        then rm -f "$log"; return
        fi
        cat "$log" >&2
        rm -f "$log"
    fi
    echo "setup: this machine lacks: $*" >&2
    echo "setup: run this line as an administrator, then the same make again:" >&2
    echo "    apt-get install -y --no-install-recommends $*" >&2
    exit 1
}

# Whether the libraries that OpenGL without a screen takes are there.
has_gl() {
    "$PYTHON" - <<'END'
import ctypes, glob, sys
try:
    for name in ("libGL.so.1", "libEGL.so.1"):
        ctypes.CDLL(name)
except OSError:
    sys.exit(1)
drivers = ("/usr/lib/*/dri/*swrast*", "/usr/lib*/dri/*swrast*", "/usr/lib/*/libgallium*", "/dev/dri/render*", "/dev/nvidia0")
sys.exit(not any(glob.glob(driver) for driver in drivers))
END
}

command -v "$PYTHON" >/dev/null 2>&1 || stop "no '$PYTHON' found; install Python 3.11 or newer, or say make PYTHON=/path/to/python3.11"
"$PYTHON" -c 'import sys; sys.exit(sys.version_info < (3, 11))' ||
    stop "$("$PYTHON" --version) is too old; forestgen wants Python 3.11 or newer: say make PYTHON=/path/to/python3.11"

lacking=""
"$PYTHON" -c 'import ensurepip, venv' 2>/dev/null || lacking="python3-venv"
has_gl || lacking="$lacking libgl1 libegl1 libgl1-mesa-dri"
# shellcheck disable=SC2086 # one word a package
[ -z "$lacking" ] || need_packages $lacking

if ! .venv/bin/python -m pip --version >/dev/null 2>&1; then # none yet, or one that was broken off
    rm -rf .venv
    "$PYTHON" -m venv .venv
fi
echo "setup: installing pinned packages into .venv"
.venv/bin/python -m pip install --quiet --disable-pip-version-check --use-pep517 -c constraints.txt -e '.[test,lint]'
.venv/bin/forestgen doctor
