#!/usr/bin/env bash
# Whether the program, the library that runs a whole system as one FMU, the extension module of the wheel, and the tests
# have their libraries with the same features: else these would be built once more for `make fmu` or `make wheel`.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

features() {
    cargo tree --prefix none --no-dedupe --edges normal,build --format '{p} {f}' "$@" | sed 's/ (\*)$//' | sort -u
}

# The first selection of packages, the second, and which Cargo.toml names too few features. Libraries of one selection
# alone are built once anyway.
same() {
    local first second different
    first=$(features $1)
    second=$(features $2)
    different=$(awk 'NR == FNR { whole[$0]; crate[$1 $2]; next } ($1 $2 in crate) && !($0 in whole)' \
        <(echo "$second") <(echo "$first"))
    if [ -n "$different" ]; then
        echo "$3 names other features of these libraries than the program or its tests need:" >&2
        echo "$different" >&2
        exit 1
    fi
}
tests="--workspace --exclude airloop-python --edges normal,build,dev"
same "-p airloop-python" "-p airloop-python -p airloop-cli" python/Cargo.toml
same "-p airloop-python" "$tests" orchestrator/system-fmu/Cargo.toml
same "-p airloop-system-fmu" "-p airloop-cli" orchestrator/system-fmu/Cargo.toml
same "-p airloop-system-fmu" "$tests" orchestrator/system-fmu/Cargo.toml
