//! `--isolate`: FMUs in processes of their own.

use std::process::ExitCode;
use std::time::Duration;

use airloop::Error;
use airloop_fmi::isolate::{self, Isolation, Which};
use airloop_series::units::parse_duration;
use clap::ValueEnum;

/// Hidden command of a worker process.
pub const WORKER: &str = "fmu-worker";

/// Options of commands that run FMUs.
#[derive(Debug, clap::Args)]
pub struct IsolateArgs {
    /// FMUs that run in a process of their own, one per FMU. There a crash, an `exit` or an endless call of the library
    /// ends that process only, and is an error that names component, function and cause.
    #[arg(long, value_enum, value_name = "WHICH", num_args = 0..=1, default_value = "none", default_missing_value = "all", require_equals = true)]
    pub isolate: IsolateChoice,
    /// With --isolate: longest time of one call into an FMU, e.g. 500ms or 2min.
    #[arg(long, value_name = "TIME", default_value = "60", value_parser = call_limit)]
    pub call_limit: f64,
    /// With --isolate: most memory (address space) of the process of an FMU, in MiB.
    #[arg(long, value_name = "MIB", default_value_t = 4096, value_parser = clap::value_parser!(u64).range(64..=1 << 32))]
    pub memory_limit: u64,
}

/// `--isolate`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum IsolateChoice {
    /// All FMUs.
    All,
    /// FMUs whose `generationTool` is not airloop.
    ThirdParty,
    /// No FMU.
    None,
}

fn call_limit(text: &str) -> Result<f64, String> {
    let limit = parse_duration(text).map_err(|error| error.to_string())?;
    if (1e-3..=1e6).contains(&limit) { Ok(limit) } else { Err("allowed are 1 ms to 1e6 s".into()) }
}

impl IsolateArgs {
    /// Has libraries loaded from now on as the options say.
    ///
    /// # Errors
    /// The program does not know its own file, which workers run.
    pub fn choose(&self) -> Result<(), Error> {
        let which = match self.isolate {
            IsolateChoice::All => Which::All,
            IsolateChoice::ThirdParty => Which::ThirdParty,
            IsolateChoice::None => return Ok(()),
        };
        isolate::choose(Some(Isolation {
            which,
            program: std::env::current_exe().map_err(Error::Output)?,
            arguments: vec![WORKER.into()],
            call_limit: Duration::from_secs_f64(self.call_limit),
            memory_limit: self.memory_limit << 20,
        }));
        Ok(())
    }
}

/// The whole work of a worker process.
pub fn work() -> ExitCode {
    match isolate::serve() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            super::output::to_stderr(&format!("error: {WORKER} is started by other commands only: {error}"));
            ExitCode::FAILURE
        }
    }
}
