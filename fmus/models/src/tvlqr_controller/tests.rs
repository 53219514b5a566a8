//! The controller against a plain loop over its equations, and its table.

use super::*;
use fmi_export::Interface;
use std::path::PathBuf;

/// A number in (-0.5, 0.5) for each place, without pattern.
fn number(i: usize) -> f64 {
    ((12.9898 * i as f64 + 1.0).sin() * 43758.5453).fract() / 2.0
}

/// A table of `rows` rows with the given sizes, contracting.
fn table(n: usize, m: usize, p: usize, rows: usize) -> (String, Vec<Vec<f64>>) {
    let mut names = vec!["time".to_owned()];
    let vector = |letter: &str, n: usize| (1..=n).map(|i| format!("{letter}[{i}]")).collect::<Vec<_>>();
    let matrix = |letter: &str, n: usize, m: usize| -> Vec<String> {
        (1..=n)
            .flat_map(|i| (1..=m).map(move |j| (i, j)))
            .map(|(i, j)| format!("{letter}[{i}][{j}]"))
            .collect()
    };
    names.extend(
        [vector("x", n), vector("u", m), vector("y", p), matrix("K", m, n), matrix("L", n, p)].concat(),
    );
    names.extend([matrix("A", n, n), matrix("B", n, m), vector("c", n), matrix("C", p, n)].concat());
    let rows: Vec<Vec<f64>> =
        (0..rows).map(|k| (0..names.len()).map(|i| 0.3 * number(i + 1000 * k)).collect()).collect();
    let mut text = names.join(",") + "\n";
    for row in &rows {
        text += &(row.iter().map(|value| format!("{value:?}")).collect::<Vec<_>>().join(",") + "\n");
    }
    (text, rows)
}

fn folder(name: &str, text: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("tvlqr-controller-{}-{name}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join(gains::FILE), text).unwrap();
    folder
}

fn step(m: &TvlqrController, q: &mut Values<f64>) {
    q.at_sample = true;
    m.equations(q).unwrap();
    let at_sample = m.u.map(|u| q[u]);
    m.sample(q);
    q.at_sample = false;
    m.equations(q).unwrap();
    assert_eq!(at_sample, m.u.map(|u| q[u]), "the held value is that of the sample");
}

#[test]
fn every_size_agrees_with_a_loop_over_the_equations() {
    for (case, (n, m, p)) in [(1, 1, 1), (7, 1, 2), (16, 4, 16), (5, 2, 3)].into_iter().enumerate() {
        let (text, rows) = table(n, m, p, 5);
        let (model, variables) = Table::of::<TvlqrController>();
        let mut q = variables.start_values(Interface::CoSimulation);
        let place = folder(&format!("loop{case}"), &text);
        model.load_resources(Some(&place), &mut q).unwrap();
        (q[model.u_min[0]], q[model.u_max[0]]) = (-0.02, 0.03);
        let mut e = vec![0.0; n];
        // Two samples more than rows: the last one holds.
        for k in 0..7 {
            let mut at = 1;
            let row = &rows[k.min(4)];
            let mut take = |len: usize| {
                at += len;
                &row[at - len..at]
            };
            let (x0, u0, y0) = (take(n), take(m), take(p));
            let (gain, correction) = (take(m * n), take(n * p));
            let (a, b, c, output) = (take(n * n), take(n * m), take(n), take(p * n));
            for j in 0..p {
                (q[model.y[j]], q[model.noise[j]]) = (number(k + 7 * j), 0.1 * number(k + 11 * j));
            }
            step(&model, &mut q);
            let innovation: Vec<f64> = (0..p)
                .map(|j| {
                    let expected: f64 = (0..n).map(|i| output[j * n + i] * e[i]).sum();
                    number(k + 7 * j) + 0.1 * number(k + 11 * j) - y0[j] - expected
                })
                .collect();
            for i in 0..n {
                e[i] += (0..p).map(|j| correction[i * p + j] * innovation[j]).sum::<f64>();
                assert!((q[model.x_hat[i]] - x0[i] - e[i]).abs() < 1e-13);
            }
            let u: Vec<f64> = (0..m)
                .map(|l| {
                    let (low, high) = if l == 0 { (-0.02, 0.03) } else { (-1e9, 1e9) };
                    (u0[l] - (0..n).map(|i| gain[l * n + i] * e[i]).sum::<f64>()).clamp(low, high)
                })
                .collect();
            for l in 0..m {
                assert!((q[model.u[l]] - u[l]).abs() < 1e-13, "{n} {m} {p}, sample {k}");
            }
            e = (0..n)
                .map(|i| {
                    let of_states: f64 = (0..n).map(|j| a[i * n + j] * e[j]).sum();
                    c[i] + of_states + (0..m).map(|l| b[i * m + l] * (u[l] - u0[l])).sum::<f64>()
                })
                .collect();
        }
        std::fs::remove_dir_all(place).unwrap();
    }
}

#[test]
fn without_feedback_the_nominal_input_is_played() {
    let (text, rows) = table(3, 1, 1, 4);
    let (model, variables) = Table::of::<TvlqrController>();
    let mut q = variables.start_values(Interface::ModelExchange);
    let place = folder("open", &text);
    model.load_resources(Some(&place), &mut q).unwrap();
    q[model.feedback] = false;
    q[model.y[0]] = 3.0;
    for row in &rows {
        step(&model, &mut q);
        assert_eq!(q[model.u[0]], row[4]);
    }
    std::fs::remove_dir_all(place).unwrap();
}

#[test]
fn what_is_wrong_with_a_table_is_named() {
    let (good, _) = table(2, 1, 1, 2);
    let cases = [
        (String::new(), "the table is empty"),
        ("time,x[1]\n0,0\n".into(), "line 1: 1 states, 0 inputs, 0 measured"),
        (good.replace("K[1][2]", "K[2][1]"), "column `K[2][1]` where `K[1][2]`"),
        (good.lines().next().unwrap().into(), "no row below"),
        (good.replacen("\n", "\nnan,", 1), "line 2, column `time`: `nan`"),
        (format!("{good}1,2\n"), "line 4: 2 fields; allowed: 19"),
        (good.replace(",C[1][2]", ""), "18 columns"),
    ];
    for (text, expected) in cases {
        let message = Gains::parse(&text, Path::new("controller.csv")).unwrap_err();
        assert!(message.starts_with("controller.csv") && message.contains(expected), "{message}");
    }
}

#[test]
fn a_missing_table_is_named_and_a_changed_one_is_read_again() {
    let (model, variables) = Table::of::<TvlqrController>();
    let mut q = variables.start_values(Interface::CoSimulation);
    let refused = |q: &mut Values<f64>, folder: Option<&Path>| match model.load_resources(folder, q) {
        Err(Refusal::Error(text)) => text,
        other => panic!("{other:?}"),
    };
    assert!(refused(&mut q, None).contains("controller.csv"));
    assert!(refused(&mut q, Some(Path::new("no-such-folder"))).contains("no-such-folder"));
    let place = folder("again", &table(2, 1, 1, 2).0);
    model.load_resources(Some(&place), &mut q).unwrap();
    let first = q[model.table];
    model.load_resources(Some(&place), &mut q).unwrap();
    assert_eq!(first, q[model.table]);
    std::fs::write(place.join(gains::FILE), table(3, 1, 1, 2).0).unwrap();
    model.load_resources(Some(&place), &mut q).unwrap();
    assert_ne!(first, q[model.table]);
    std::fs::remove_dir_all(place).unwrap();
}

#[test]
fn a_signal_that_is_not_finite_and_crossed_limits_are_refused() {
    let (model, variables) = Table::of::<TvlqrController>();
    let mut q = variables.start_values(Interface::CoSimulation);
    q.at_sample = true;
    q[model.y[0]] = f64::NAN;
    assert!(matches!(model.equations(&mut q), Err(Refusal::Error(text)) if text.contains("x_hat[1]")));
    q[model.u_min[1]] = 2.0;
    q[model.u_max[1]] = 1.0;
    assert!(matches!(model.prepare(&mut q), Err(Refusal::Error(text)) if text.contains("u_min[2] = 2")));
}

/// One state that stays where it is and is not corrected; feedback of 1 in the second phase.
const TWO_PHASES: &str = "time,sample,mode,x[1],u[1],y[1],K[1][1],L[1][1],A[1][1],B[1][1],c[1],C[1][1]\n\
    0,0,5,10,1,0,0,0,1,0,0,1\n1,1,5,11,1,0,0,0,1,0,0,1\n2,2,5,12,1,0,0,0,1,0,0,1\n\
    1,1,7,20,2,0,1,0,1,0,0,1\n2,2,7,21,3,0,1,0,1,0,0,1\n";

#[test]
fn a_phase_begins_when_its_mode_is_seen_and_the_estimate_goes_on() {
    let (model, variables) = Table::of::<TvlqrController>();
    let mut q = variables.start_values(Interface::CoSimulation);
    let place = folder("phases", TWO_PHASES);
    model.load_resources(Some(&place), &mut q).unwrap();
    let mut at = |mode: i32| {
        q[model.mode] = mode;
        step(&model, &mut q);
        (q[model.x_hat[0]], q[model.u[0]])
    };
    assert_eq!(at(5), (10.0, 1.0));
    // A mode of no phase changes nothing.
    assert_eq!(at(3), (11.0, 1.0));
    // x_hat was 12 by the first phase; the second plans 21 here, and its feedback answers the difference.
    assert_eq!(at(7), (12.0, 3.0 - (12.0 - 21.0)));
    // A phase that is over does not come back, and its last row holds.
    assert_eq!(at(5), (12.0, 12.0));
    std::fs::remove_dir_all(place).unwrap();
}

#[test]
fn without_feedback_phases_begin_by_plan() {
    let (model, variables) = Table::of::<TvlqrController>();
    let mut q = variables.start_values(Interface::CoSimulation);
    let place = folder("by-plan", TWO_PHASES);
    model.load_resources(Some(&place), &mut q).unwrap();
    q[model.feedback] = false;
    let mut at = |mode: i32| {
        q[model.mode] = mode;
        step(&model, &mut q);
        q[model.u[0]]
    };
    // Samples 1 and 2 belong to both phases; the second begins in the middle, at 2, whatever the mode.
    assert_eq!([at(5), at(7), at(5), at(5)], [1.0, 1.0, 3.0, 3.0]);
    std::fs::remove_dir_all(place).unwrap();
}

#[test]
fn gaps_and_fractions_in_the_samples_of_a_phase_are_named() {
    let cases = [
        (TWO_PHASES.replace("2,2,5", "2,4,5"), "line 4: sample 4; in this phase 2 is next"),
        (TWO_PHASES.replace("1,1,7", "1,1,7.5"), "line 5: sample 1, mode 7.5"),
        (TWO_PHASES.replace("0,0,5", "0,-1,5"), "line 2: sample -1"),
    ];
    for (text, expected) in cases {
        let message = Gains::parse(&text, Path::new("controller.csv")).unwrap_err();
        assert!(message.contains(expected), "{message}");
    }
}

#[test]
fn phases_begin_again_further_on() {
    let (model, variables) = Table::of::<TvlqrController>();
    let text = format!("{TWO_PHASES}repeat,3,100\n");
    let place = folder("again-and-again", &text);
    let mut q = variables.start_values(Interface::CoSimulation);
    model.load_resources(Some(&place), &mut q).unwrap();
    let mut at = |mode: i32| {
        q[model.mode] = mode;
        step(&model, &mut q);
        (q[model.x_hat[0]], q[model.u[0]])
    };
    assert_eq!([at(5), at(7), at(7)], [(10.0, 1.0), (11.0, 2.0 + 9.0), (12.0, 3.0 + 9.0)]);
    // x_hat was 12 at the end of the second phase; the first one plans 110 here, but has no feedback.
    assert_eq!([at(5), at(5)], [(12.0, 1.0), (13.0, 1.0)]);
    // The second one plans 121 in its last row.
    assert_eq!(at(7), (14.0, 3.0 - (14.0 - 121.0)));

    let mut q = variables.start_values(Interface::CoSimulation);
    model.load_resources(Some(&place), &mut q).unwrap();
    q[model.feedback] = false;
    let mut played = || {
        step(&model, &mut q);
        q[model.u[0]]
    };
    let played: Vec<f64> = (0..7).map(|_| played()).collect();
    assert_eq!(played, [1.0, 1.0, 3.0, 1.0, 1.0, 3.0, 1.0]);
    std::fs::remove_dir_all(place).unwrap();
}

#[test]
fn a_line_of_repetition_that_does_not_fit_is_named() {
    for line in ["repeat,3", "repeat,3,1,2", "repeat,0,1", "repeat,2.5,1", "repeat,3,inf"] {
        let message =
            Gains::parse(&format!("{TWO_PHASES}{line}\n"), Path::new("controller.csv")).unwrap_err();
        assert!(message.contains("line 7: `repeat` stands below phases"), "{message}");
    }
    let (text, _) = table(1, 1, 1, 2);
    assert!(Gains::parse(&format!("{text}repeat,2,1\n"), Path::new("c.csv")).is_err());
}
