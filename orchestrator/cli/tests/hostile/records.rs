//! Records in CSV files.

use super::Case;

/// A record of an input and an output.
fn record(change: impl Fn(usize, String) -> String) -> String {
    let mut text = "time,u,y\n".to_owned();
    let mut y = 0.0_f64;
    for k in 0..60_u32 {
        let u = f64::from(k * 7919 % 13) / 13.0;
        y = 0.8 * y + 0.2 * u;
        let row = format!("{},{u:.4},{y:.4}", f64::from(k) / 100.0);
        text += &(change(k as usize, row) + "\n");
    }
    text
}

pub fn cases() -> Vec<Case> {
    let run = |what: &str, text: String| {
        Case::new(what, "run m.fmu --input r.csv --step 10ms -o out").fmu().file("r.csv", text)
    };
    let row =
        |what: &str, other: &str| run(what, record(|k, row| if k == 30 { other.to_owned() } else { row }));
    let identify = |what: &str, command: &str, cell: &str| {
        let text = record(|k, row| {
            let (start, _) = row.rsplit_once(',').unwrap();
            if k == 30 { format!("{start},{cell}") } else { row }
        });
        Case::new(what, command).file("r.csv", text)
    };
    let state_space = "identify state-space r.csv --inputs u --outputs y -o out";
    let arx = "identify arx r.csv --inputs u --outputs y -o out";
    vec![
        Case::new("no file", "run m.fmu --input r.csv --step 10ms -o out").fmu(),
        run("an empty file", String::new()),
        run("a header alone", "time,u\n".into()),
        run("no column of time", "t,u\n0,1\n1,2\n".into()),
        run("a column twice", "time,u,u\n0,1,2\n1,2,3\n".into()),
        run("zeros", "\0\0\0\0".into()),
        row("a row with too few cells", "0.30"),
        row("a row with too many cells", "0.30,1,2,3"),
        row("a cell that is a word", "0.30,one,2"),
        row("a cell of NaN", "0.30,nan,2"),
        row("a cell of infinity", "0.30,inf,2"),
        row("a cell beyond all numbers", "0.30,1e400,2"),
        row("an empty cell", "0.30,,2"),
        row("time that stands still", "0.29,1,2"),
        row("time that goes back", "0.10,1,2"),
        run("a column of no input", "time,w\n0,1\n1,2\n".into()),
        identify("a cell of -1e308", state_space, "-1e308"),
        identify("a cell of -1e308", arx, "-1e308"),
        identify("a cell of NaN", state_space, "nan"),
        Case::new("five rows", state_space).file("r.csv", "time,u,y\n0,0,0\n1,1,1\n2,0,1\n3,1,1\n4,0,1\n"),
        Case::new("an input that never changes", arx)
            .file("r.csv", record(|k, _| format!("{},1,{}", k as f64 / 100.0, k % 3))),
    ]
}
