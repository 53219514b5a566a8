//! `airloop identify arx` through the binary: coefficients, files, exit codes, messages.

use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Output};

use airloop_ident::model::{Linear, file};
use airloop_series::csv;
use serde_json::Value;
use tempfile::TempDir;

fn airloop(folder: &TempDir, words: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_airloop")).args(words).current_dir(folder.path()).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn write(folder: &TempDir, name: &str, text: &str) {
    std::fs::write(folder.path().join(name), text).unwrap();
}

fn summary(folder: &TempDir, output: &str) -> Value {
    let text = std::fs::read_to_string(folder.path().join(output).join("summary.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// Uniform values between -1 and 1.
fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// Steps of random height, held for 40 samples.
fn stairs(n: usize, amplitude: f64, seed: u64) -> Vec<f64> {
    let mut next = noise(seed);
    let levels: Vec<f64> = (0..n.div_ceil(40)).map(|_| amplitude * next()).collect();
    (0..n).map(|k| levels[k / 40]).collect()
}

/// Eq. 8 of the paper, with uniform equation noise of half width `size`.
fn eq8(u: &[f64], size: f64, seed: u64) -> [Vec<f64>; 2] {
    let mut next = noise(seed);
    let mut y = [vec![0.0; u.len()], vec![0.0; u.len()]];
    for k in 0..u.len() {
        let (a, b, before) = if k == 0 { (0.0, 0.0, 0.0) } else { (y[0][k - 1], y[1][k - 1], u[k - 1]) };
        y[0][k] = 1.0144 * a - 0.0216 * b + 0.6619 * u[k] - 0.6557 * before + size * next();
        y[1][k] = 0.0527 * a + 0.9537 * b + 0.0764 * u[k] - 0.0847 * before + size * next();
    }
    y
}

fn table(header: &str, step: f64, columns: &[&[f64]]) -> String {
    let mut text = format!("{header}\n");
    for k in 0..columns[0].len() {
        write!(text, "{:.4}", k as f64 * step).unwrap();
        columns.iter().for_each(|column| write!(text, ",{}", column[k]).unwrap());
        text.push('\n');
    }
    text
}

fn record(folder: &TempDir, name: &str, n: usize, size: f64, seed: u64) {
    let u = stairs(n, 40.0, seed);
    let [y1, y2] = eq8(&u, size, seed + 100);
    write(folder, name, &table("time,u [N],F_hat [N],F_p [N]", 1e-3, &[&u, &y1, &y2]));
}

const SIGNALS: [&str; 4] = ["--inputs", "u", "--outputs", "F_hat,F_p"];

fn identify(folder: &TempDir, words: &[&str]) -> Output {
    airloop(folder, &[&["identify", "arx"], words, &SIGNALS[..]].concat())
}

#[test]
fn eq_8_comes_back_with_its_files() {
    let folder = tempfile::tempdir().unwrap();
    record(&folder, "a.csv", 3000, 0.0, 1);
    record(&folder, "b.csv", 2000, 0.0, 2);
    record(&folder, "check.csv", 2000, 0.0, 3);
    let output = identify(&folder, &["a.csv", "b.csv", "--validate", "check.csv", "-o", "out/m"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let printed = text(&output.stdout);
    assert!(
        printed.starts_with("arx, least squares: 4998 samples of 0.001 s in 2 records, stable"),
        "{printed}"
    );
    let summary = summary(&folder, "out/m");
    let coefficients = &summary["coefficients"];
    for (name, expected) in [
        ("A1", [[-1.0144, 0.0216], [-0.0527, -0.9537]].concat()),
        ("B0", vec![0.6619, 0.0764]),
        ("B1", vec![-0.6557, -0.0847]),
    ] {
        let rows = coefficients[name].as_array().unwrap().iter();
        let found: Vec<f64> =
            rows.flat_map(|row| row.as_array().unwrap()).map(|x| x.as_f64().unwrap()).collect();
        assert_eq!(found.len(), expected.len());
        assert!(found.iter().zip(&expected).all(|(x, y)| (x - y).abs() < 1e-9), "{name}: {found:?}");
    }
    assert_eq!(summary["stable"], true);
    for set in ["estimation", "validation"] {
        for fit in ["fit_simulated", "fit_one_step"] {
            for output in ["F_hat", "F_p"] {
                assert!(
                    (summary[set][fit][output].as_f64().unwrap() - 100.0).abs() < 1e-6,
                    "{set} {fit} {output}"
                );
            }
        }
    }
    let out = folder.path().join("out/m");
    for file in ["estimation_1.csv", "estimation_2.csv", "validation.csv", "validation_F_p.svg", "index.html"]
    {
        assert!(out.join(file).is_file(), "{file}");
    }
    let Linear::Arx(model) = file::load(&out.join("model.toml")).unwrap().model else { panic!() };
    assert_eq!(model.a[0][(1, 0)], coefficients["A1"][1][0].as_f64().unwrap());
    let played = csv::read(&out.join("validation.csv")).unwrap();
    let names: Vec<&str> = played.channels().iter().map(|channel| channel.name.as_str()).collect();
    let expected =
        ["u", "F_hat", "F_p", "F_hat_simulated", "F_p_simulated", "F_hat_one_step", "F_p_one_step"];
    assert_eq!(names, expected);
    assert_eq!(std::fs::read_dir(&out).unwrap().filter(|f| hidden(f.as_ref().unwrap())).count(), 0);
}

fn hidden(entry: &std::fs::DirEntry) -> bool {
    entry.file_name().to_string_lossy().starts_with('.')
}

#[test]
fn files_read_anew_for_every_pass_give_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    record(&folder, "a.csv", 9000, 0.5, 1);
    record(&folder, "b.csv", 5000, 0.5, 2);
    for detrend in ["none", "mean", "linear"] {
        for order in [&["--na", "2", "--nb", "2"][..], &["--order", "auto", "--na", "1..2", "--nk", "0..1"]] {
            let words = [&["a.csv", "b.csv", "--detrend", detrend][..], order].concat();
            for (name, more) in [("memory", &[][..]), ("stream", &["--stream"])] {
                let output = identify(&folder, &[&words[..], more, &["-o", name]].concat());
                assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
            }
            let bytes = |name: &str| {
                let folder = folder.path().join(name);
                let mut files: Vec<_> =
                    std::fs::read_dir(&folder).unwrap().map(|f| f.unwrap().file_name()).collect();
                files.sort();
                files
                    .into_iter()
                    .map(|f| (f.clone(), std::fs::read(folder.join(f)).unwrap()))
                    .collect::<Vec<_>>()
            };
            assert!(bytes("memory") == bytes("stream"), "--detrend {detrend} {order:?}");
        }
    }
}

#[test]
fn the_search_names_the_true_orders_and_keeps_its_table() {
    let folder = tempfile::tempdir().unwrap();
    let u = stairs(6000, 10.0, 5);
    let mut next = noise(6);
    let mut y = vec![0.0; u.len()];
    for k in 4..u.len() {
        y[k] = 1.6 * y[k - 1] - 0.7 * y[k - 2] + u[k - 3] + 0.5 * u[k - 4] + 0.2 * next();
    }
    write(&folder, "r.csv", &table("time,u,y", 0.08, &[&u, &y]));
    let words = [
        "identify",
        "arx",
        "r.csv",
        "--inputs",
        "u",
        "--outputs",
        "y",
        "--order",
        "auto",
        "--nk",
        "0..4",
        "-o",
        "o",
    ];
    let output = airloop(&folder, &words);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let summary = summary(&folder, "o");
    assert_eq!(summary["structure"], serde_json::json!({"na": [[2]], "nb": [[2]], "nk": [[3]]}));
    assert_eq!(summary["sample_time"], 0.08);
    let orders = std::fs::read_to_string(folder.path().join("o/orders.csv")).unwrap();
    assert!(
        orders.starts_with("rank,na,nb,nk,coefficients,stable,fit_simulated,\"fit_y\",aicc,bic,mdl,taken\n")
    );
    let taken: Vec<&str> = orders.lines().filter(|line| line.ends_with(",true")).collect();
    assert!(taken.len() == 1 && taken[0].contains(",2,2,3,4,true,"), "{taken:?}");
    assert_eq!(orders.lines().count(), 1 + 4 * 4 * 5);
    assert!(text(&output.stdout).contains("warning: no validation files"), "{}", text(&output.stdout));
}

#[test]
fn output_error_leaves_no_bias_where_least_squares_does() {
    let folder = tempfile::tempdir().unwrap();
    let mut next = noise(77);
    for (name, seed) in [("a.csv", 1), ("check.csv", 2)] {
        let u = stairs(6000, 40.0, seed);
        let y = eq8(&u, 0.0, 1).map(|y| y.into_iter().map(|y| y + 0.87 * next()).collect::<Vec<_>>());
        write(&folder, name, &table("time,u,F_hat,F_p", 1e-3, &[&u, &y[0], &y[1]]));
    }
    let fit = |method: &str| {
        let output =
            identify(&folder, &["a.csv", "--validate", "check.csv", "--method", method, "-o", method]);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        summary(&folder, method)["validation"]["mean_fit_simulated"].as_f64().unwrap()
    };
    let (least_squares, variables, output_error) =
        (fit("least-squares"), fit("instrumental-variables"), fit("output-error"));
    assert!(output_error > least_squares + 2.0, "{least_squares} {output_error}");
    assert!((variables - output_error).abs() < 0.5, "{variables} {output_error}");
}

#[test]
fn an_unstable_model_has_no_simulated_fit() {
    let folder = tempfile::tempdir().unwrap();
    let u = stairs(400, 1.0, 5);
    let mut next = noise(6);
    let mut y = vec![0.0; u.len()];
    (1..u.len()).for_each(|k| y[k] = 1.01 * y[k - 1] + u[k] + 0.1 * next());
    write(&folder, "r.csv", &table("time,u,y", 0.1, &[&u, &y]));
    let words = ["identify", "arx", "r.csv", "--inputs", "u", "--outputs", "y", "--nb", "1", "-o", "o"];
    let output = airloop(&folder, &words);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let summary = summary(&folder, "o");
    assert_eq!(
        (&summary["stable"], &summary["estimation"]["fit_simulated"]["y"]),
        (&Value::Bool(false), &Value::Null)
    );
    assert!(summary["estimation"]["fit_one_step"]["y"].as_f64().unwrap() > 90.0);
    assert!(text(&output.stdout).contains("UNSTABLE") && text(&output.stdout).contains("unstable"));
}

#[test]
fn bad_records_are_refused_with_the_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let n = 400;
    let u = stairs(n, 10.0, 1);
    let [y, _] = eq8(&u, 0.1, 2);
    let rows = |edit: &dyn Fn(usize) -> Option<String>| -> String {
        let rows: Vec<String> = (0..n)
            .map(|k| edit(k).unwrap_or_else(|| format!("{:.3},{},{}\n", k as f64 * 1e-3, u[k], y[k])))
            .collect();
        format!("time,u [N],y [kPa]\n{}", rows.concat())
    };
    let good = rows(&|_| None);
    let lines: Vec<&str> = good.lines().collect();
    for (name, text, expected) in [
        ("short", [&lines[..1], &lines[39..43]].concat().join("\n"), "too few for"),
        ("tiny", lines[..3].join("\n"), "2 samples are too few"),
        (
            "constant",
            rows(&|k| Some(format!("{:.3},5,{}\n", k as f64 * 1e-3, y[k]))),
            "column `u` is 5 in every row",
        ),
        ("gap", rows(&|k| (100..150).contains(&k).then(String::new)), "line 102: gap from 0.099 s to 0.15 s"),
        (
            "jitter",
            rows(&|k| {
                Some(format!(
                    "{:.6},{},{}\n",
                    k as f64 * 1e-3 + if k % 7 == 3 { 3e-4 } else { 0.0 },
                    u[k],
                    y[k]
                ))
            }),
            "unevenly sampled",
        ),
        (
            "nan",
            rows(&|k| Some(format!("{:.3},{},NaN\n", k as f64 * 1e-3, u[k]))),
            "column `y` has no number in any row",
        ),
        (
            "hole",
            rows(&|k| (k == 50).then(|| format!("0.050,{},\n", u[50]))),
            "line 52, column `y`: the value is missing, as in 1 of 400",
        ),
        (
            "rates",
            rows(&|k| (k % 10 != 0).then(|| format!("{:.3},{},\n", k as f64 * 1e-3, u[k]))),
            "only at every 10. row",
        ),
        (
            "text",
            rows(&|k| (k == 9).then(|| "0.009,a,1\n".into())),
            "line 11, column `u`: `a` is not a number",
        ),
        ("back", rows(&|k| (k == 9).then(|| "0.001,1,1\n".into())), "line 11, column `time`"),
    ] {
        write(&folder, "bad.csv", &text);
        let words = ["identify", "arx", "bad.csv", "--inputs", "u", "--outputs", "y", "-o", "o"];
        let output = airloop(&folder, &words);
        let message = self::text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{name}: {message}");
        assert!(message.contains(expected), "{name}: {message}");
        assert!(!Path::new(&folder.path().join("o")).exists(), "{name} leaves a folder");
    }
    write(&folder, "good.csv", &good);
    write(&folder, "other.csv", &good.replace("[kPa]", "[Pa]"));
    write(&folder, "slow.csv", &table("time,u,y", 2e-3, &[&u, &y]));
    for (words, code, expected) in [
        (&["good.csv", "--validate", "other.csv"][..], 1, "column `y` is in [Pa], but in [kPa] in good.csv"),
        (
            &["good.csv", "slow.csv"],
            1,
            "good.csv: samples every 0.001 s, but slow.csv has them every 0.002 s",
        ),
        (&["good.csv", "--na", "2,1"], 2, "--na 2,1"),
        (&["good.csv", "--order", "auto", "--na", "4..1"], 2, "make 0 structures"),
        (&["good.csv", "--method", "output-error", "--stream"], 1, "needs all samples in memory"),
        (&["missing.csv"], 1, "missing.csv"),
    ] {
        let words = [&["identify", "arx"], words, &["--inputs", "u", "--outputs", "y", "-o", "o"]].concat();
        let output = airloop(&folder, &words);
        let message = self::text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{words:?}: {message}");
        assert!(message.contains(expected), "{words:?}: {message}");
    }
    let words = ["identify", "arx", "good.csv", "--inputs", "u", "--outputs", "F", "-o", "o"];
    assert!(
        self::text(&airloop(&folder, &words).stderr).contains("there is no column `F`; the file has: u, y")
    );
    let words = ["identify", "arx", "good.csv", "--inputs", "u", "--outputs", "u", "-o", "o"];
    assert!(self::text(&airloop(&folder, &words).stderr).contains("column `u` is named twice"));
}

#[test]
fn an_earlier_result_leaves_no_file_behind() {
    let folder = tempfile::tempdir().unwrap();
    record(&folder, "a.csv", 1000, 0.1, 1);
    record(&folder, "b.csv", 1000, 0.1, 2);
    assert!(identify(&folder, &["a.csv", "b.csv", "--order", "auto", "-o", "o"]).status.success());
    write(&folder, "o/notes.txt", "of the user");
    assert!(identify(&folder, &["a.csv", "--no-plots", "-o", "o"]).status.success());
    let entries = std::fs::read_dir(folder.path().join("o")).unwrap();
    let mut files: Vec<String> = entries.map(|f| f.unwrap().file_name().into_string().unwrap()).collect();
    files.sort();
    assert_eq!(files, ["estimation.csv", "index.html", "model.toml", "notes.txt", "summary.json"]);
}

#[test]
fn files_of_the_user_are_not_replaced() {
    let folder = tempfile::tempdir().unwrap();
    for (name, seed) in [("estimation_1.csv", 1), ("b.csv", 2), ("validation.csv", 3), ("a.csv", 4)] {
        record(&folder, name, 400, 0.1, seed);
    }
    let bytes = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    let before = bytes("estimation_1.csv");
    let refused = |words: &[&str], file: &str| {
        let output = identify(&folder, words);
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{message}");
        assert!(message.contains(&format!("`{file}`")) && message.contains("another folder"), "{message}");
        assert!(!folder.path().join("model.toml").exists());
    };
    refused(&["estimation_1.csv", "b.csv", "-o", "."], "estimation_1.csv");
    refused(&["a.csv", "--validate", "b.csv", "-o", "."], "validation.csv");
    assert_eq!(bytes("estimation_1.csv"), before);
    // An earlier result is replaced, unless it is read.
    for _ in 0..2 {
        assert_eq!(identify(&folder, &["a.csv", "-o", "out"]).status.code(), Some(0));
    }
    refused(&["out/estimation.csv", "b.csv", "-o", "out"], "estimation.csv");
    // A figure whose name is not that of an earlier result.
    std::fs::remove_file(folder.path().join("validation.csv")).unwrap();
    write(&folder, "step_responses.svg", "mine");
    refused(&["a.csv", "-o", "."], "step_responses.svg");
    assert_eq!(bytes("step_responses.svg"), b"mine");
}

#[test]
fn a_model_too_large_for_an_fmu_leaves_no_result() {
    let folder = tempfile::tempdir().unwrap();
    record(&folder, "a.csv", 2000, 0.5, 1);
    let output = identify(&folder, &["a.csv", "--na", "9", "--nb", "9", "--fmu", "large", "-o", "out"]);
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{message}");
    if message.contains("18 states") {
        assert!(message.contains("12 at most"), "{message}");
    } else {
        // Without the FMUs there is nothing to derive from.
        assert!(message.contains("linear-state-space"), "{message}");
    }
    assert!(!folder.path().join("out").exists());
}
