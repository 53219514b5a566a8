//! Identifies a first-order ARX model from a record with known truth:
//! `cargo run -p airloop-ident --example identify_arx`.

use airloop_ident::{arx, record::Record, structure::Structure};
use airloop_series::random::Random;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // y(k) = 0.8 y(k-1) + u(k-1) + e(k), e with a standard deviation of 0.01
    let mut random = Random::new(1);
    let u: Vec<f64> = (0..2000).map(|_| random.symmetric()).collect();
    let mut y = vec![0.0; u.len()];
    for k in 1..u.len() {
        y[k] = 0.8 * y[k - 1] + u[k - 1] + 0.01 * random.normal();
    }
    let record = Record { sample_time: 0.1, inputs: vec![u], outputs: vec![y], ..Record::default() };
    let (inputs, outputs) = (["u".to_owned()], ["y".to_owned()]);
    let names = arx::Names { inputs: &inputs, outputs: &outputs };
    let structure = Structure::uniform((1, 1), 1, 2, 0);
    let found = arx::estimate(&[&record], &structure, 0.1, (&[0.0], &[0.0]), names)?;
    println!("pole {:.4} (truth 0.8)", -found.model.a[0][(0, 0)]);
    Ok(())
}
