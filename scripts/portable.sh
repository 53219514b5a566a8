#!/usr/bin/env bash
# Builds the libraries of all FMUs without libgcc_s, against the same old glibc as `make fmu` (RHEL 8), by cargo-zigbuild, and
# packages every FMU with them. The linker lands in target/zig. Says what is missing, and stops, where it cannot be had.
# The library inside of exported systems (`airloop export-fmu`) is not among them: it keeps its libgcc_s.
set -euo pipefail

glibc=2.28
target=$(rustc -vV | sed -n 's/^host: //p')
cd "$(dirname "${BASH_SOURCE[0]}")/.."

fail() {
    printf 'portable: %s\n' "$@" >&2
    exit 1
}

case $target in
    x86_64-*-linux-gnu) platform=linux64 ;;
    *-linux-gnu) platform=${target%%-*}-linux ;;
    *) fail "this is no Linux with glibc ($target)" ;;
esac

built=${CARGO_TARGET_DIR:-target}
tools=$built/zig
mkdir -p "$built"
if ! cmp -s requirements-portable.txt "$tools/installed.txt"; then
    rm -rf "$tools"
    "${PYTHON:-python3}" -m venv "$tools" || fail "could not make a virtual environment. On Debian: apt-get install python3-venv"
    "$tools/bin/python" -m pip install --quiet --disable-pip-version-check --retries 10 -r requirements-portable.txt ||
        fail "pip could not install requirements-portable.txt: see the lines above"
    cp requirements-portable.txt "$tools/installed.txt"
fi

source scripts/fmu_crates.sh
PATH=$(cd "$tools/bin" && pwd):$PATH cargo-zigbuild zigbuild --release --target "$target.$glibc" "${packages[@]}"

out=$built/portable/$platform
rm -rf "$out"
mkdir -p "$out"
for name in "${names[@]}"; do
    cp "$built/$target/release/lib$name.so" "$out/$name.so"
done
"${PYTHON:-python3}" scripts/check_symbols.py "$glibc" "$out"/*.so
scripts/packager.sh release --add-platform "$built/portable"
