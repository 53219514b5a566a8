//! Records in CSV files.

use std::path::Path;

use super::Case;

const RUN: &str = "run m.fmu --input r.csv --step 10ms -o out";

fn link(to: &str, path: &Path) {
    std::os::unix::fs::symlink(to, path).unwrap();
}

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
    fn run(what: &str, text: impl Into<Vec<u8>>) -> Case {
        Case::new(what, RUN).fmu().file("r.csv", text)
    }
    let other = |what: &str, make: fn(&Path)| Case::new(what, RUN).fmu().make(make);
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
        Case::new("no file", RUN).fmu(),
        run("an empty file", String::new()),
        run("a header alone", "time,u\n"),
        run("no column of time", "t,u\n0,1\n1,2\n"),
        run("a column twice", "time,u,u\n0,1,2\n1,2,3\n"),
        run("zeros", "\0\0\0\0"),
        row("a row with too few cells", "0.30"),
        row("a row with too many cells", "0.30,1,2,3"),
        row("a cell that is a word", "0.30,one,2"),
        row("a cell of NaN", "0.30,nan,2"),
        row("a cell of infinity", "0.30,inf,2"),
        row("a cell beyond all numbers", "0.30,1e400,2"),
        row("a cell whose square is beyond all numbers", "0.30,1e308,2"),
        row("an empty cell", "0.30,,2"),
        row("time that stands still", "0.29,1,2"),
        row("time that goes back", "0.10,1,2"),
        run("a column of no input", "time,w\n0,1\n1,2\n"),
        run("UTF-16", {
            let text: Vec<u8> =
                "\u{feff}time,u\n0,1\n1,2\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
            text
        }),
        run("line ends of an old Macintosh", "time,u\r0,1\r1,2\r"),
        run("semicolons and decimal commas", "time;u\n0,0;1,5\n1,0;2,5\n"),
        run("tabs", "time\tu\n0\t1\n1\t2\n"),
        run("a comment above the header", "# logger 3\ntime,u\n0,1\n1,2\n"),
        run("a row of units", "time,u\ns,N\n0,1\n1,2\n"),
        run("a unit that is none of time", "time [furlong],u\n0,1\n1,2\n"),
        run("times of day", "time,u\n2024-01-01T00:00:00,1\n2024-01-01T00:00:01,2\n"),
        run("a quote that stays open", "\"time,u\n0,1\n1,2\n"),
        run("a control character in a name", "time,u\u{1b}[31m\n0,1\n1,2\n"),
        run("4,096 zero bytes at the end (power cut)", format!("time,u\n0,1\n1,2\n{}", "\0".repeat(4096))),
        run("the last row cut off", "time,u\n0,1\n1,2\n2"),
        run("a hexadecimal number", "time,u\n0,0x10\n1,2\n"),
        run("a minus sign of typography", "time,u\n0,\u{2212}1\n1,2\n"),
        run("a time of infinity", "time,u\n0,1\ninf,2\n"),
        run("a time of 1e308 s", "time,u\n0,1\n1e308,2\n"),
        run(
            "200,000 columns of one name",
            format!("time{}\n0{}\n", ",u".repeat(200_000), ",0".repeat(200_000)),
        ),
        run("a line of 80 MiB", format!("time,u\n0,{}\n1,2\n", "1".repeat(80 << 20))),
        other("a folder", |folder| std::fs::create_dir(folder.join("r.csv")).unwrap()),
        other("a named pipe", |folder| super::pipe(&folder.join("r.csv"))),
        other("a link to /dev/zero", |folder| link("/dev/zero", &folder.join("r.csv"))),
        other("a link to itself", |folder| link("r.csv", &folder.join("r.csv"))),
        identify("a cell of -1e308", state_space, "-1e308"),
        identify("a cell of -1e308", arx, "-1e308"),
        identify("a cell of NaN", state_space, "nan"),
        Case::new("five rows", state_space).file("r.csv", "time,u,y\n0,0,0\n1,1,1\n2,0,1\n3,1,1\n4,0,1\n"),
        Case::new("an input that never changes", arx)
            .file("r.csv", record(|k, _| format!("{},1,{}", k as f64 / 100.0, k % 3))),
    ]
}
