#!/usr/bin/env bash
# Builds the libraries of all FMUs against an old glibc (RHEL 8, Debian 11, Ubuntu 20.04), without libgcc_s, by cargo-zigbuild, and
# packages every FMU with them. The linker lands in target/zig. Says what is missing, and stops, where it cannot be had.
set -euo pipefail

glibc=2.28
target=$(rustc -vV | sed -n 's/^host: //p')
cd "$(dirname "${BASH_SOURCE[0]}")/.."

fail() {
    printf 'portable: %s\n' "$@" >&2
    exit 1
}

case $target in
    *-linux-gnu) ;;
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

packages=()
for manifest in fmus/*/Cargo.toml; do
    grep -q cdylib "$manifest" || continue
    packages+=(-p "$(sed -n 's/^name = "\(fmu-.*\)"/\1/p' "$manifest")")
done
PATH=$(cd "$tools/bin" && pwd):$PATH cargo-zigbuild zigbuild --release --target "$target.$glibc" "${packages[@]}"
"${PYTHON:-python3}" scripts/check_symbols.py "$glibc" "$built/$target/release"/*.so
cargo run --release -p packager -- --lib-dir "$built/$target/release"
