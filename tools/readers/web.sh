#!/bin/sh
# Readers on the web, pinned in package.json: fetched once into node_modules, then the tests run them offline.
set -eu
cd "$(dirname "$0")/../.."
if ! npm install --prefix tools/readers --no-package-lock --no-audit --no-fund --silent; then
    echo "readers: web skipped: npm could not install tools/readers/package.json"
    exit 0
fi
.venv/bin/pytest -q tests/export/test_web.py
