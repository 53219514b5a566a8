#!/usr/bin/env bash
# Builds the program and the libraries of all FMUs for Windows (x86_64) with mingw, and packages every FMU with the
# binaries of both platforms: airloop.exe finds them in the folder fmu beside its own. Says what is missing, and stops,
# where the Rust target or the linker is not there.
set -euo pipefail

target=x86_64-pc-windows-gnu
cd "$(dirname "${BASH_SOURCE[0]}")/.."

fail() {
    printf 'windows: %s\n' "$@" >&2
    exit 1
}

command -v x86_64-w64-mingw32-gcc >/dev/null ||
    fail "x86_64-w64-mingw32-gcc is not on the PATH. On Debian: apt-get install gcc-mingw-w64-x86-64-win32"
[ -d "$(rustc --print sysroot)/lib/rustlib/$target" ] || rustup target add "$target" ||
    fail "the standard library of Rust for $target is not there and could not be added: rustup target add $target"

source scripts/fmu_crates.sh
cargo build --release --target "$target" "${packages[@]}" -p airloop-cli

built=${CARGO_TARGET_DIR:-target}
out=$built/windows
mkdir -p "$out/win64"
for name in "${names[@]}"; do
    cp "$built/$target/release/$name.dll" "$out/win64/"
done
scripts/packager.sh release --add-platform "$out"
cp "$built/$target/release/airloop.exe" "$out/"
x86_64-w64-mingw32-strip "$out/airloop.exe"
echo "$out/airloop.exe"
