//! Settings of the command line.

use super::Case;

pub fn cases() -> Vec<Case> {
    let run = |words: &str| {
        Case::new(words, &format!("run m.fmu -o out {words}")).fmu().file("r.csv", "time,u\n0,0\n1,1\n")
    };
    let excite = |words: &str| Case::new(words, &format!("excite {words} -o out.csv"));
    let identify = |words: &str| {
        let rows =
            (0..120_u32).map(|k| format!("{},{},{}\n", f64::from(k) / 100.0, k * 7919 % 13, k * 7919 % 11));
        let text = "time,u,y\n".to_owned() + &rows.collect::<String>();
        Case::new(words, &format!("identify {words} -o out")).file("r.csv", text)
    };
    let mut found: Vec<Case> = [
        "--stop 1 --step 0",
        "--stop 1 --step -1ms",
        "--stop 1 --step nan",
        "--stop 1 --step inf",
        "--stop 1 --step 1e400",
        "--stop 1 --step ms",
        "--stop 1 --step 3furlong",
        "--stop 1e300 --step 1ms",
        "--stop 1 --step 1e-300",
        "--stop -1 --step 1ms",
        "--stop nan --step 1ms",
        "--start 2 --stop 1 --step 1ms",
        "--stop 3 --step 1e-9",
        "--stop 3 --step 1e-9 --estimate-coupling-error",
        "--stop 1 --step 1ms --set",
        "--stop 1 --step 1ms --set x",
        "--stop 1 --step 1ms --set mass=1",
        "--stop 1 --step 1ms --set x=one",
        "--stop 1 --step 1ms --set x=nan",
        "--stop 1 --step 1ms --set y=1",
        "--stop 1 --step 1ms --master euler",
        "--stop 1 --step 1ms --interpolation cubic",
        "--stop 1 --step 1ms --output-step 0",
        "--stop 1 --step 1ms --output-step -1",
        "--stop 1 --step 1ms --output-step 0.5ms",
        "--stop 1 --step 1ms --save-states 0",
        "--stop 1 --step 1ms --save-states 1e308",
        "--stop 1 --step 1ms --master monolithic --save-states 1s",
        "--stop 1 --step 1ms --restart-from none",
        "--stop 1 --step 1ms --restart-from r.csv",
        "--stop 1 --step 1ms --extrapolation 9",
        "--stop 1 --step 1ms --input none.csv",
        "--stop 1 --step 1ms --measured none.csv",
        "--stop 1 --step 1ms --signals none.toml",
        "--stop 1 --step 1ms --tolerance -1",
        "--stop 1 --step 1ms --isolate=some",
        "--stop 1 --step 1ms --isolate --call-limit 0",
        "--stop 1 --step 1ms --isolate --memory-limit 0",
        "--stop 1 --step 1ms --adaptive --min-step 2 --max-step 1",
        "--stop 1 --step 1ms --unknown",
        "--stop 1 --step 1ms --stop 2",
        "--stop 1 --step 1ms -o m.fmu",
    ]
    .into_iter()
    .map(run)
    .collect();
    found.extend(
        [
            "chirp --amplitude 0 --band 1..5 --duration 10s",
            "chirp --amplitude nan --band 1..5 --duration 10s",
            "chirp --amplitude 1 --band 0..5 --duration 10s",
            "chirp --amplitude 1 --band 1..5000 --duration 10s",
            "chirp --amplitude 1 --band 1..5 --duration 0",
            "chirp --amplitude 1 --band 1..5 --duration 10s --step 1e-9",
            "multisine --amplitude 1 --band 0.00001..499 --duration 90000s",
            "multisine --amplitude 1 --band 0.01..499 --duration 100s --period 1000s",
            "multisine --amplitude 1 --band 0.1..10 --duration 10s --period 1e308",
            "prbs --amplitude 1 --clock 0 --order 7 --duration 10s",
            "prbs --amplitude 1 --clock 10ms --order 99 --duration 10s",
            "prbs --amplitude 1 --clock 1e30 --order 7 --duration 10s",
        ]
        .map(excite),
    );
    found.extend(
        [
            "arx r.csv --inputs u --outputs u",
            "arx r.csv --inputs w --outputs y",
            "arx r.csv --inputs u --outputs y --validate none.csv",
            "state-space r.csv --inputs u --outputs y --order 0",
            "state-space r.csv --inputs u --outputs y --order 99",
            "state-space r.csv --inputs u --outputs y --order 40",
            "state-space r.csv --inputs u --outputs y --horizon 1",
            "state-space r.csv --inputs u --outputs y --horizon 9999",
            "state-space none.csv --inputs u --outputs y",
        ]
        .map(identify),
    );
    found.extend([
        Case::new(
            "a command into a named pipe",
            "excite prbs --amplitude 1 --clock 1 --order 5 --duration 9s -o p",
        )
        .make(|folder| super::pipe(&folder.join("p"))),
        Case::new("a figure into a device", "effects show stribeck --figure d")
            .make(|folder| std::os::unix::fs::symlink("/dev/full", folder.join("d")).unwrap()),
        Case::new("a figure over a file of the user", "effects show stribeck --figure m.svg")
            .file("m.svg", "mine"),
        Case::new("an FMU into an endless device", "derive m.fmu -o d --set tau=2")
            .fmu()
            .make(|folder| std::os::unix::fs::symlink("/dev/zero", folder.join("d")).unwrap()),
        Case::new("an unknown command", "runn m.fmu"),
        Case::new("refine of nothing", "refine none -o out"),
        Case::new("refine of a file of another kind", "refine r.csv -o out").file("r.csv", "time,u\n0,0\n"),
        Case::new("optimize of nothing", "optimize none.toml -o out"),
        Case::new("inspect of a folder", "inspect tmp"),
    ]);
    found
}
