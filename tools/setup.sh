#!/bin/sh
# Leave a working .venv in the checkout: pinned packages, forestgen itself, and GL libraries for the renderer.
set -eu
PYTHON="${PYTHON:-python3}"

# Run a command as root where that is possible without asking for a password.
as_root() {
    if [ "$(id -u)" = 0 ]; then "$@"
    elif command -v sudo >/dev/null 2>&1 && sudo -n true 2>/dev/null; then sudo -n "$@"
    else return 1
    fi
}

# Install Debian packages, or print the line that would and stop.
need_packages() {
    if command -v apt-get >/dev/null 2>&1 && as_root true 2>/dev/null; then
        echo "setup: installing $*"
        as_root env DEBIAN_FRONTEND=noninteractive apt-get update -qq
        as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >/dev/null
    else
        echo "setup: this machine lacks: $*" >&2
        echo "setup: run this line as an administrator, then the same make again:" >&2
        echo "    apt-get install -y --no-install-recommends $*" >&2
        exit 1
    fi
}

command -v "$PYTHON" >/dev/null 2>&1 || { echo "setup: no '$PYTHON' found; install Python 3.11 or newer, or set PYTHON=" >&2; exit 1; }
"$PYTHON" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || {
    echo "setup: $("$PYTHON" --version) is too old; forestgen wants Python 3.11 or newer (set PYTHON=/path/to/python3.11)" >&2
    exit 1
}

if ! "$PYTHON" -c 'import ensurepip, venv' 2>/dev/null; then
    need_packages python3-venv
fi

has_gl() {
    "$PYTHON" - <<'EOF'
import ctypes, sys
try:
    egl = ctypes.CDLL("libEGL.so.1")
    ctypes.CDLL("libGLESv2.so.2")
    egl.eglGetDisplay.restype = ctypes.c_void_p
except OSError:
    sys.exit(1)
import glob
sys.exit(not (glob.glob("/usr/lib/*/dri/*swrast*") or glob.glob("/usr/lib*/dri/*swrast*") or glob.glob("/dev/dri/render*")))
EOF
}
has_gl || need_packages libegl1 libgl1-mesa-dri libgles2

[ -x .venv/bin/python ] || "$PYTHON" -m venv .venv
echo "setup: installing pinned packages into .venv"
.venv/bin/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test,lint]'
.venv/bin/forestgen doctor
