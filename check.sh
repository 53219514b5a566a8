#!/usr/bin/env bash
# What CI checks before it runs any test. `make check` sets up first, then calls this.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"

step() {
    echo "== $*"
    "$@"
}

step cargo fmt --all --check
step cargo clippy --workspace --all-targets -- -D warnings
RUSTDOCFLAGS="-D warnings" step cargo doc --workspace --no-deps --quiet
step scripts/packager.sh dev --check
step scripts/check_one_build.sh
step "${PYTHON:-.venv/bin/python}" scripts/check_words.py
if cargo deny --version >/dev/null 2>&1; then
    step cargo deny check licenses bans sources
else
    step "${PYTHON:-.venv/bin/python}" scripts/check_licenses.py
fi
