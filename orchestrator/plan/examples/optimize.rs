//! Plans a motion from a problem file: `cargo run --release -p airloop-plan --example optimize -- PROBLEM.toml`.

use std::ops::ControlFlow;

use airloop_plan::guess;
use airloop_plan::prepare::prepare;
use airloop_plan::solve::{Begin, Session, Settings};

fn main() -> Result<(), airloop_plan::Error> {
    let Some(problem) = std::env::args_os().nth(1) else {
        println!("usage: optimize PROBLEM.toml (try examples/03_swing_up/problem.toml after `make fmu`)");
        return Ok(());
    };
    let prepared = prepare(problem.as_ref())?;
    let choice = guess::choose(&prepared.statement, None)?;
    let rough = guess::guess(&prepared.statement, &prepared.catalog, &prepared.task, &choice)?;
    let settings = Settings::of(&prepared.statement);
    let mut session = Session::new(&prepared, settings.threads)?;
    let solved =
        session.solve(&prepared.setup, &settings, Begin::From(&rough), &mut |_| ControlFlow::Continue(()))?;
    println!("{}, objective {}", solved.status(), solved.trajectory().objective);
    Ok(())
}
