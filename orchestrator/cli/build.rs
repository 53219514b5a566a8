//! Hands on the argument for the linker in `AIRLOOP_LINK_ARGUMENT`: the Python package is linked for size.

fn main() {
    println!("cargo::rerun-if-env-changed=AIRLOOP_LINK_ARGUMENT");
    if let Ok(argument) = std::env::var("AIRLOOP_LINK_ARGUMENT") {
        println!("cargo::rustc-link-arg={argument}");
    }
}
