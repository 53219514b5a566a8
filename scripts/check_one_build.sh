#!/usr/bin/env bash
# Whether the extension module of the wheel, and the library that runs a whole system as one FMU, have their libraries
# with the features that these have in the program: else they would be built once more, the first for `make wheel`, the
# second for `make fmu`. And whether the tests have them so.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

features() {
    cargo tree --prefix none --no-dedupe --edges normal,build --format '{p} {f}' "$@" | sed 's/ (\*)$//' | sort -u
}

# The first selection of packages, the second, and which Cargo.toml names too few features.
same() {
    local first second different
    first=$(features $1)
    second=$(features $2)
    different=$(comm -23 <(echo "$first") <(echo "$second"))
    if [ -n "$different" ]; then
        echo "$3 names other features of these libraries than the program or its tests need:" >&2
        echo "$different" >&2
        exit 1
    fi
}
same "-p airloop-python" "-p airloop-python -p airloop-cli" python/Cargo.toml
same "-p airloop-system-fmu" "-p airloop-cli" orchestrator/system-fmu/Cargo.toml
same "-p airloop-system-fmu" "--workspace --exclude airloop-python --edges normal,build,dev" orchestrator/system-fmu/Cargo.toml
