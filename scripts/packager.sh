#!/usr/bin/env bash
# Runs the packager: `packager.sh PROFILE [ARGUMENT...]`, PROFILE being `dev` or `release`. It is built with the features
# that its libraries have in the program, which `cargo run -p packager` would build once more without them.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
profile=$1
shift
cargo build --quiet --workspace --exclude airloop-python --bin packager --profile "$profile"
[ "$profile" = dev ] && folder=debug || folder=$profile
exec "${CARGO_TARGET_DIR:-target}/$folder/packager" "$@"
