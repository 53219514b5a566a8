#!/usr/bin/env bash
# Whether the extension module of the wheel has its libraries with the features that they have beside the program: else
# `make wheel` would build all of them twice.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

features() {
    cargo tree --prefix none --no-dedupe --edges normal,build --format '{p} {f}' "$@" | sed 's/ (\*)$//' | sort -u
}

different=$(comm -23 <(features -p airloop-python) <(features -p airloop-python -p airloop-cli))
if [ -n "$different" ]; then
    echo "The program needs more features of these libraries than python/Cargo.toml names:" >&2
    echo "$different" >&2
    exit 1
fi
