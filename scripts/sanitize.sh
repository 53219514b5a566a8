#!/usr/bin/env bash
# The tests of the importer, of the masters and of the FMUs of this project with the C parts and the test FMUs in C under
# the compiler's sanitizers of addresses and undefined behavior, in a target folder of their own; then the unit
# tests of the export under Miri, where a nightly toolchain with it is installed.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
host=$(rustc -vV | sed -n 's/^host: //p')
folder=$PWD/target/sanitize
mkdir -p "$folder"
cat >"$folder/cc" <<'CC'
#!/bin/sh
exec cc -g -fno-omit-frame-pointer -fsanitize=address,undefined -fno-sanitize-recover=undefined "$@"
CC
chmod +x "$folder/cc"
# Rust keeps what it needs to the end. The allocator of the sanitizer keeps freed memory for a while and counts none, so
# that tests of leaks say nothing here.
export ASAN_OPTIONS=detect_leaks=0 UBSAN_OPTIONS=print_stacktrace=1
# The runtimes come before all other libraries.
runtime=$(cc -print-file-name=libasan.so):$(cc -print-file-name=libubsan.so)
runner=CARGO_TARGET_$(tr 'a-z-' 'A-Z_' <<<"$host")_RUNNER
env "$runner=env LD_PRELOAD=$runtime" CC="$folder/cc" CARGO_TARGET_DIR="$folder" RUSTFLAGS="-C link-arg=-lasan -C link-arg=-lubsan" \
    cargo test --quiet --target "$host" -p airloop-fmi -p airloop-cosim -- \
    --skip leave_no_memory_behind --skip defective_fmus_are_found_by_their_rules
# The unit tests: the others have a logger in Rust, where it cannot take the arguments of C's that Miri asks for.
if cargo +nightly miri --version >/dev/null 2>&1; then
    MIRIFLAGS="-Zmiri-disable-isolation -Zmiri-deterministic-floats" CARGO_TARGET_DIR=$folder/miri \
        cargo +nightly miri test --quiet -p fmi-export --lib
else
    echo "Miri skipped: no nightly toolchain with it (rustup toolchain install nightly --component miri)"
fi
