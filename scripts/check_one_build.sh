#!/usr/bin/env bash
# Whether the program, the library that runs a whole system as one FMU, the extension module of the wheel, and the tests
# have their libraries with the same features: else these would be built once more for `make fmu` or `make wheel`.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

# Libraries with their features: `features EDGES PACKAGES`.
features() {
    cargo tree --prefix none --no-dedupe --format '{p} {f}' --edges "$@" | sed 's/ (\*)$//' | sort -u
}

# The first selection of packages, the second with edges of its own, and which Cargo.toml names too few features.
# Libraries of one selection alone are built once anyway. A library that code for the build (macros) has, too, may have
# other features there, so those of the program are compared alone as well.
same() {
    local first second different alone
    for alone in ,no-proc-macro ,build; do
        first=$(features "normal$alone" $1)
        second=$(features "normal$2$alone" $3)
        different=$(awk 'NR == FNR { whole[$0]; crate[$1 $2]; next } ($1 $2 in crate) && !($0 in whole)' \
            <(echo "$second") <(echo "$first"))
        if [ -n "$different" ]; then
            echo "$4 names other features of these libraries than the program or its tests need:" >&2
            echo "$different" >&2
            exit 1
        fi
    done
}
tests="--workspace --exclude airloop-python"
same "-p airloop-python" "" "-p airloop-python -p airloop-cli" python/Cargo.toml
same "-p airloop-python" ",dev" "$tests" orchestrator/system-fmu/Cargo.toml
same "-p airloop-python" "" "$tests" orchestrator/system-fmu/Cargo.toml
same "-p airloop-system-fmu" "" "-p airloop-cli" orchestrator/system-fmu/Cargo.toml
same "-p airloop-system-fmu" ",dev" "$tests" orchestrator/system-fmu/Cargo.toml
