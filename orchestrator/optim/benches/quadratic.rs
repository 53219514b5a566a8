//! Convex quadratic programs from a file, one thread: `cargo bench -p airloop-optim --bench quadratic -- FILE`.
//!
//! Lines of the file: `program NAME VARIABLES ROWS`, then entries from 0: `P i j value` of the Hessian (one triangle),
//! `q i value` of the gradient, `A i j value` of the rows, `r i lower upper` and `x i lower upper` bounds. Prints one
//! line of comma-separated values per program. `tests/study/programs/quadratic.py` writes the file, from the collection
//! of Maros and Mészáros, and compares.

#![allow(missing_docs, reason = "a bench has no public items")]

use std::time::{Duration, Instant};

use airloop_optim::{Bounds, Quadratic, QuadraticSolution, solve_quadratic};

const REPETITIONS: usize = 3;

fn main() {
    let file = std::env::args().skip(1).find(|word| !word.starts_with("--")).expect("a file is named");
    let text = std::fs::read_to_string(&file).expect("the file can be read");
    println!("name,variables,constraints,status,objective,ms");
    for part in text.split("program ").skip(1) {
        let (name, problem) = read(part);
        let (mut least, mut found) = (Duration::MAX, None);
        for _ in 0..REPETITIONS {
            let begin = Instant::now();
            let solution = solve_quadratic(&problem).expect("the program is well posed");
            least = least.min(begin.elapsed());
            found = Some(solution);
        }
        let solution = found.expect("there are repetitions");
        println!(
            "{name},{},{},{:?},{:e},{:.4}",
            problem.gradient.len(),
            problem.row_bounds.lower.len(),
            solution.status,
            objective(&problem, &solution),
            1e3 * least.as_secs_f64()
        );
    }
}

fn read(part: &str) -> (String, Quadratic) {
    let mut lines = part.lines();
    let head: Vec<&str> = lines.next().expect("a head").split_whitespace().collect();
    let size = |at: usize| head[at].parse::<usize>().expect("a size");
    let mut problem = Quadratic {
        hessian: Vec::new(),
        gradient: vec![0.0; size(1)],
        rows: Vec::new(),
        row_bounds: Bounds::free(size(2)),
        bounds: Bounds::free(size(1)),
    };
    for line in lines {
        let words: Vec<&str> = line.split_whitespace().collect();
        let place = |at: usize| words[at].parse::<usize>().expect("a place");
        let number = |at: usize| words[at].parse::<f64>().expect("a number");
        match words[0] {
            "P" => problem.hessian.push((place(1), place(2), number(3))),
            "q" => problem.gradient[place(1)] = number(2),
            "A" => problem.rows.push((place(1), place(2), number(3))),
            kind => {
                let bounds = if kind == "r" { &mut problem.row_bounds } else { &mut problem.bounds };
                (bounds.lower[place(1)], bounds.upper[place(1)]) = (number(2), number(3));
            }
        }
    }
    (head[0].to_owned(), problem)
}

/// `x' P x / 2 + q' x`.
fn objective(problem: &Quadratic, solution: &QuadraticSolution) -> f64 {
    let x = &solution.x;
    let square =
        |&(i, j, p): &(usize, usize, f64)| if i == j { 0.5 * p * x[i] * x[i] } else { p * x[i] * x[j] };
    let linear = problem.gradient.iter().zip(x).map(|(q, x)| q * x);
    problem.hessian.iter().map(square).sum::<f64>() + linear.sum::<f64>()
}
