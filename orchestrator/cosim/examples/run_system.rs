//! Runs a system of FMUs with its defaults: `cargo run -p airloop-cosim --example run_system -- SYSTEM.ssd RESULT.csv`.

use std::sync::atomic::AtomicBool;

use airloop_cosim::master::{Settings, simulate};
use airloop_cosim::system::SystemGraph;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut words = std::env::args_os().skip(1);
    let (Some(system), Some(result)) = (words.next(), words.next()) else {
        println!("usage: run_system SYSTEM.ssd RESULT.csv (try examples/01_run/system.ssd after `make fmu`)");
        return Ok(());
    };
    let graph = SystemGraph::open(system.as_ref())?;
    let settings = Settings { stop_time: 2.0, step_size: 1e-3, ..Settings::default() };
    let stop = AtomicBool::new(false);
    let watch = simulate::Watch { stop: &stop, progress: &mut |_, _| {} };
    let run = simulate::run(&graph, &settings, None, watch)?;
    airloop_series::csv::write(&run.result, result.as_ref())?;
    println!("{} rows", run.result.time().len());
    Ok(())
}
