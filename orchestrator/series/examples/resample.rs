//! Reads a record and looks its signals up between the samples: `cargo run -p airloop-series --example resample`.

use airloop_series::{Interpolation, csv};

const RECORD: &str = "time,x,u\n0,0,5\n0.1,0.012,5\n0.2,0.030,-5\n";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let record = csv::parse(RECORD, "record.csv".as_ref())?;
    let halfway = record.resample(vec![0.0, 0.05, 0.1, 0.15, 0.2], Interpolation::Linear)?;
    let x = halfway.channel("x").ok_or("the record has no column x")?;
    for (time, x) in halfway.time().iter().zip(&x.values) {
        println!("t = {time:.2} s: x = {:.1} mm", 1e3 * x);
    }
    Ok(())
}
