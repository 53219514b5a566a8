# Sourced from the root of the repository: `packages` are the options that name the crates of all FMUs, `names` their libraries.
packages=()
names=()
for manifest in fmus/*/Cargo.toml; do
    grep -q cdylib "$manifest" || continue
    packages+=(-p "$(sed -n 's/^name = "\(fmu-.*\)"/\1/p' "$manifest")")
    names+=("$(sed -n '/^\[lib\]/,/^\[/s/^name = "\(.*\)"/\1/p' "$manifest")")
done
