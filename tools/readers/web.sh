#!/bin/sh
# Readers on the web, pinned in package.json: fetched once into node_modules, run offline from there.
#   web.sh install   only that
#   web.sh           that, and the tests that ask them
set -eu
cd "$(dirname "$0")/../.."
if ! command -v npm >/dev/null; then
    echo "readers: web skipped: no npm"
elif npm install --prefix tools/readers --no-package-lock --no-audit --no-fund --silent; then
    echo "readers: three and gltf-validator are there"
else
    echo "readers: web skipped: npm could not install tools/readers/package.json"
fi
[ "${1:-}" = install ] || .venv/bin/pytest -q tests/readers/test_three.py
