//! The program `airloop`; everything is in the library, see `airloop::cli`.

fn main() -> std::process::ExitCode {
    airloop::cli::main()
}
