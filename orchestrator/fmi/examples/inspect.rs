//! Opens an FMU, lists its variables and checks its description:
//! `cargo run -p airloop-fmi --example inspect -- FILE.fmu`.

use airloop_fmi::{Fmu, check};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let Some(path) = std::env::args_os().nth(1) else {
        println!("usage: inspect FILE.fmu (`make fmu` writes some into target/fmu)");
        return Ok(());
    };
    let fmu = Fmu::open(path.as_ref())?;
    println!("{}", fmu.description.model_name);
    for variable in &fmu.description.variables {
        println!("  {:?} {}", variable.causality, variable.name);
    }
    for finding in check::static_findings(&fmu) {
        println!("{}: {}", finding.severity, finding.message);
    }
    Ok(())
}
