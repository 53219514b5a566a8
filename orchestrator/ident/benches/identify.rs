//! Cost of an ARX estimate and of an order search, against NumPy in the same run.
//!
//! - ARX with na = nb = 2, two outputs, one input, 1e6 samples from memory, against NumPy forming the same regressor
//!   and LAPACK's QR of it, one thread each. Limit: 1.2 times.
//! - Search over 64 structures on 1e5 samples (and 1e5 that judge), against one QR of the largest structure. Limit: 3
//!   times LAPACK's.
//!
//! Run it with `cargo bench -p airloop-ident --bench identify`. Without `.venv/bin/python` with NumPy the other side is
//! left out.

#![allow(missing_docs, reason = "a bench has no public items")]

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use airloop_ident::arx::{self, Names};
use airloop_ident::order_search::{self, Ranges};
use airloop_ident::record::Record;
use airloop_ident::regressor::Regression;
use airloop_ident::source::Source;
use airloop_ident::structure::Structure;

const TURNS: usize = 7;
const OFFSETS: (&[f64], &[f64]) = (&[0.0], &[0.0, 0.0]);

/// Prints the best of some turns of: regressor and QR for the estimate; the same for the largest structure.
const NUMPY: &str = "
import os
for name in ('OMP_NUM_THREADS', 'OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS'):
    os.environ[name] = '1'
import time
import numpy as np

def seconds(n, na, nb):
    rng = np.random.default_rng(0)
    u, y = rng.standard_normal(n), rng.standard_normal((n, 2))
    lags = max(na, nb - 1)
    rows = slice(lags, n)
    best = np.inf
    for _ in range(7):
        start = time.perf_counter()
        x = [-y[lags - k : n - k, l] for k in range(1, na + 1) for l in range(2)] + [u[lags - k : n - k] for k in range(nb)]
        np.linalg.qr(np.column_stack(x + [y[rows, 0], y[rows, 1]]), mode='r')
        best = min(best, time.perf_counter() - start)
    return best

print(seconds(1_000_000, 2, 2), seconds(100_000, 4, 7))
";

fn main() {
    let (inputs, outputs) = (["u".to_owned()], ["y1".to_owned(), "y2".to_owned()]);
    let names = Names { inputs: &inputs, outputs: &outputs };
    let long = record(1_000_000, 1);
    let structure = Structure::uniform((1, 2), 2, 2, 0);
    let estimate = best(|| {
        let sources: [&dyn Source; 1] = [&long];
        arx::estimate(&sources, &structure, 1e-3, OFFSETS, names).expect("the data excite the model");
    });
    let (estimation, judging) = (record(100_000, 2), record(100_000, 3));
    let ranges = Ranges { na: 1..=4, nb: 1..=4, nk: 0..=3 };
    let factorization = best(|| {
        Regression::of(&[&estimation], &ranges.largest((1, 2)), OFFSETS).expect("the data are in memory");
    });
    let search = best(|| {
        order_search::search(&[&estimation], &[&judging], &ranges, 1e-3, OFFSETS, names)
            .expect("the data excite");
    });
    let numpy = numpy();
    let ratio = |own: Duration, other: f64| format!("{:.2} times", own.as_secs_f64() / other);
    println!("identify: ARX na=nb=2, 2 outputs, 1e6 samples: {estimate:.1?}");
    println!("identify: QR of the largest of 64 structures, 1e5 samples: {factorization:.1?}");
    println!(
        "identify: search over the 64: {search:.1?}, {} its own QR",
        ratio(search, factorization.as_secs_f64())
    );
    match numpy {
        Some((qr, largest)) => {
            println!("identify: NumPy and LAPACK: {:.1} ms, ours is {}", 1e3 * qr, ratio(estimate, qr));
            println!(
                "identify: LAPACK's QR of the largest: {:.1} ms, our search is {}",
                1e3 * largest,
                ratio(search, largest)
            );
        }
        None => println!("identify: NumPy left out, as .venv/bin/python does not run it"),
    }
}

fn best(mut work: impl FnMut()) -> Duration {
    (0..TURNS)
        .map(|_| {
            let start = Instant::now();
            work();
            start.elapsed()
        })
        .min()
        .unwrap_or_default()
}

fn numpy() -> Option<(f64, f64)> {
    let python = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../.venv/bin/python");
    let output =
        Command::new(python).args(["-c", NUMPY]).output().ok().filter(|output| output.status.success())?;
    let text = String::from_utf8(output.stdout).ok()?;
    let mut seconds = text.split_whitespace().filter_map(|word| word.parse().ok());
    Some((seconds.next()?, seconds.next()?))
}

/// Eq. 8 driven by random steps, with equation noise.
fn record(n: usize, seed: u64) -> Record {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let mut level = 0.0;
    let mut u = Vec::with_capacity(n);
    let mut y = [Vec::with_capacity(n), Vec::with_capacity(n)];
    let (mut a, mut b, mut before) = (0.0, 0.0, 0.0);
    for k in 0..n {
        if k % 50 == 0 {
            level = 20.0 * next();
        }
        (a, b) = (
            1.0144 * a - 0.0216 * b + 0.6619 * level - 0.6557 * before + 0.5 * next(),
            0.0527 * a + 0.9537 * b + 0.0764 * level - 0.0847 * before + 0.5 * next(),
        );
        before = level;
        u.push(level);
        y[0].push(a);
        y[1].push(b);
    }
    Record { name: "bench".into(), sample_time: 1e-3, start: 0.0, inputs: vec![u], outputs: y.into() }
}
