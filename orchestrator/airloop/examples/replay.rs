//! Runs a system with its defaults through the one library that has all parts: `cargo run -p airloop --example replay
//! -- SYSTEM.ssd`.

use std::sync::atomic::AtomicBool;

use airloop::cosim::master::{Settings, simulate};
use airloop::cosim::system::SystemGraph;

fn main() -> Result<(), airloop::Error> {
    let Some(system) = std::env::args_os().nth(1) else {
        println!("usage: replay SYSTEM.ssd (try examples/01_run/system.ssd after `make fmu`)");
        return Ok(());
    };
    let graph = SystemGraph::open(system.as_ref())?;
    let settings = Settings { stop_time: 2.0, step_size: 1e-3, ..Settings::default() };
    let stop = AtomicBool::new(false);
    let watch = simulate::Watch { stop: &stop, progress: &mut |_, _| {} };
    let run = simulate::run(&graph, &settings, None, watch)?;
    println!("{} signals, {} rows", run.result.channels().len(), run.result.time().len());
    Ok(())
}
