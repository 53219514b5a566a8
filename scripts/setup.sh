#!/usr/bin/env bash
# Prepares this folder for building (`setup.sh build`), for building and testing (`setup.sh test`), or for that and the
# studies (`setup.sh study`).
# Everything lands in .venv/ and .cargo/config.toml; nothing outside this folder is touched and no root is needed.
# Run again at any time: it does nothing when the requirements have not changed.
#
# libclang comes from the pinned Python package, also where the system has one: every machine then generates the C
# bindings with the same version, and no distribution's file layout has to be searched. A LIBCLANG_PATH in the
# environment wins over it.
set -euo pipefail

purpose=${1:-test}
case $purpose in
    build) requirements=requirements-build.txt oldest_python="3, 8" ;;
    test) requirements=requirements.txt oldest_python="3, 11" ;;
    study) requirements=requirements-study.txt oldest_python="3, 11" ;;
    *)
        echo "usage: scripts/setup.sh [build|test|study]" >&2
        exit 2
        ;;
esac
cd "$(dirname "${BASH_SOURCE[0]}")/.."

fail() {
    printf 'setup: %s\n' "$@" >&2
    exit 1
}

command -v cargo >/dev/null || fail "cargo is not on the PATH. Install Rust from https://rustup.rs and open a new shell."
compiler=${CC:-$(command -v gcc || command -v cc || command -v clang || true)}
[ -n "$compiler" ] || fail "no C compiler found (looked for \$CC, gcc, cc, clang). On Debian: apt-get install gcc libc6-dev"
python=${PYTHON:-python3}
command -v "$python" >/dev/null || fail "python3 is not on the PATH. On Debian: apt-get install python3 python3-venv"
"$python" -c "import sys; sys.exit(sys.version_info < ($oldest_python))" ||
    fail "$("$python" --version) is too old, Python ${oldest_python/, /.} or newer is needed; name another one with PYTHON=..."

# A virtual environment whose interpreter was removed or upgraded away is made anew.
if ! .venv/bin/python -m pip --version >/dev/null 2>&1; then
    rm -rf .venv
    log=$(mktemp)
    # Debian splits ensurepip off into python3-venv; pip (22.3 or newer) or virtualenv can stand in for it.
    "$python" -m venv .venv >"$log" 2>&1 ||
        { rm -rf .venv && "$python" -m venv --without-pip .venv >>"$log" 2>&1 &&
            "$python" -m pip --python .venv/bin/python install --quiet pip >>"$log" 2>&1; } ||
        { rm -rf .venv && "$python" -m virtualenv .venv >>"$log" 2>&1; } ||
        {
            cat "$log" >&2
            rm -rf .venv "$log"
            fail "could not make a virtual environment. On Debian: apt-get install python3-venv"
        }
    rm -f "$log"
fi

digest=$(cat requirements-build.txt requirements.txt "$requirements" | sha256sum | cut -d' ' -f1)
stamp=.venv/installed-$purpose
if [ "$(cat "$stamp" 2>/dev/null)" != "$digest" ]; then
    echo "setup: installing $requirements into .venv"
    .venv/bin/python -m pip install --quiet --no-input --disable-pip-version-check --retries 10 -r "$requirements" ||
        fail "pip could not install $requirements: see the lines above; run the same command again once the network is back"
    echo "$digest" >"$stamp"
fi

# Ecos (ecospy) links against Debian's libtbb12. Where the system does not have it, the package is unpacked into .venv; the
# tests that run Ecos are skipped where that is not possible either.
if [ "$purpose" != build ] && [ ! -e .venv/lib/libtbb.so.12 ] && command -v apt-get >/dev/null && command -v dpkg-deb >/dev/null; then
    present=$(ldconfig -p 2>/dev/null | sed -n 's/.*libtbb\.so\.12 .*=> //p' | head -n 1)
    folder=$(mktemp -d)
    if [ -n "$present" ]; then
        ln -s "$present" .venv/lib/libtbb.so.12
    elif (cd "$folder" && apt-get download -qq libtbb12 && dpkg-deb -x libtbb12_*.deb .) 2>/dev/null; then
        find "$folder" -name 'libtbb.so.12*' -exec cp -P {} .venv/lib/ \;
    else
        echo "setup: no libtbb.so.12: the tests that run Ecos will be skipped (as root: apt-get install libtbb12)"
    fi
    rm -rf "$folder"
fi

# Plain `cargo build` finds libclang through .cargo/config.toml. The package holds the library without clang's own
# headers (stddef.h ...), so those of the C compiler are named. Written only when it changes.
libclang=$(.venv/bin/python -c 'import os, clang; print(os.path.join(os.path.dirname(clang.__file__), "native"))')
headers=$("$compiler" -print-file-name=include)
config=$(
    cat <<TOML
# Written by scripts/setup.sh; not under version control.
[env]
LIBCLANG_PATH = '$libclang'
BINDGEN_EXTRA_CLANG_ARGS = '-I"$headers"'
TOML
)
if [ "$(cat .cargo/config.toml 2>/dev/null)" != "$config" ]; then
    mkdir -p .cargo
    printf '%s\n' "$config" >.cargo/config.toml
fi
