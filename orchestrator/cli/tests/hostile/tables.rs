//! Cases, studies, problems and models in TOML files.

use super::Case;

const CASE: &str = r#"id = "c"
kind = "cartpole"
sample_rate_hz = 100
[model.actuator]
sample_time = 0.001
A1 = [[-1.0144, 0.0216], [-0.0527, -0.9537]]
B0 = [0.6619, 0.0764]
B1 = [-0.6557, -0.0847]
[model.cart_friction]
c1 = 5.7910
c2 = 63.7045
c3 = 0.0064
c4 = 0.0
c5 = -2.3170
[model.cart_pole]
m_c = 0.399
m_p = 0.1
l = 0.2
g = 9.81
b_p = 0.0006
tip_distance = 0.25
[sensors.u]
unit = "N"
noise_rms = 0.0
[sensors.x]
unit = "m"
noise_rms = 0.0001
[[files]]
name = "r.csv"
role = "estimation"
experiment = "coupled"
[[files]]
name = "r.csv"
role = "validation"
experiment = "coupled"
"#;

const STUDY: &str = r#"system = "m.fmu"
[inputs]
u = { column = "u" }
[outputs]
y = { column = "y", noise = 0.01 }
[[segment]]
file = "r.csv"
role = "estimation"
from_s = 0.0
to_s = 0.5
[[segment]]
file = "r.csv"
role = "validation"
from_s = 0.5
[error]
windows_s = 0.2
"#;

const NO_TASKS: &str = r#"kind = "simulate"
system = "m.fmu"
[run]
stop = 1.0
step = 0.01
[sample]
method = "latin-hypercube"
count = 0
[[factors]]
name = "x"
from = 1
to = 2
[[quantities]]
name = "y"
signal = "y"
of = "final"
"#;

fn record() -> String {
    let rows = (0..120_u32).map(|k| format!("{},{},{}\n", f64::from(k) / 100.0, k % 7, k % 5));
    "time,u,y\n".to_owned() + &rows.collect::<String>()
}

pub fn cases() -> Vec<Case> {
    let case = |what: &str, from: &str, to: &str| {
        assert!(CASE.contains(from), "{from}");
        Case::new(what, "refine case.toml -o out")
            .file("case.toml", CASE.replacen(from, to, 1))
            .file("r.csv", "time,u,x\n0,1,0\n0.01,1,0\n")
    };
    let case =
        |what: &str, from: &str, to: &str| Case { command: "refine . -o out".into(), ..case(what, from, to) };
    let study = |what: &str, from: &str, to: &str| {
        assert!(STUDY.contains(from), "{from}");
        Case::new(what, "refine study.toml -o out")
            .fmu()
            .file("study.toml", STUDY.replacen(from, to, 1))
            .file("r.csv", record())
    };
    let text = |what: &str, command: &str, name: &str, text: &str| Case::new(what, command).file(name, text);
    let utf16: Vec<u8> = STUDY.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let utf16 = [vec![0xff, 0xfe], utf16].concat();
    vec![
        case("A1 with NaN", "-1.0144", "nan"),
        case("A1 that is unstable", "-1.0144", "-1.2"),
        case("B0 with infinity", "0.6619", "inf"),
        case("a sample time of zero", "sample_time = 0.001", "sample_time = 0.0"),
        case("c5 = inf", "c5 = -2.3170", "c5 = inf"),
        case("m_p = 0", "m_p = 0.1", "m_p = 0.0"),
        case("a length below zero", "l = 0.2", "l = -0.2"),
        case("g = nan", "g = 9.81", "g = nan"),
        case("noise of zero", "noise_rms = 0.0001", "noise_rms = 0.0"),
        case("a sample rate of zero", "sample_rate_hz = 100", "sample_rate_hz = 0"),
        case("an unknown key", "m_c = 0.399", "mass = 0.399"),
        case("no validation record", "\"validation\"", "\"estimation\""),
        study("a step of 1e-9 s", "system = \"m.fmu\"", "system = \"m.fmu\"\nstep_s = 1e-9"),
        study("a step of NaN", "system = \"m.fmu\"", "system = \"m.fmu\"\nstep_s = nan"),
        study("noise below zero", "noise = 0.01", "noise = -0.01"),
        study("windows of zero", "windows_s = 0.2", "windows_s = 0.0"),
        study("a begin of NaN", "from_s = 0.0", "from_s = nan"),
        study("an end before the begin", "to_s = 0.5", "to_s = -1.0"),
        study("a file that is not there", "file = \"r.csv\"", "file = \"s.csv\""),
        study("a column that is not there", "column = \"y\"", "column = \"z\""),
        study("a system that is not there", "m.fmu", "n.fmu"),
        study("an unknown role", "\"validation\"", "\"testing\""),
        study("a number for a text", "file = \"r.csv\"", "file = 5"),
        Case { command: "refine study.toml -o out".into(), ..text("an empty study", "", "study.toml", "") },
        Case {
            command: "refine study.toml -o out".into(),
            ..text("UTF-16", "", "study.toml", "").file("study.toml", utf16)
        },
        Case::new("a study that is a named pipe", "refine . -o out")
            .make(|folder| super::pipe(&folder.join("case.toml"))),
        Case::new("a problem that is a link to /dev/zero", "optimize p.toml -o out")
            .make(|folder| std::os::unix::fs::symlink("/dev/zero", folder.join("p.toml")).unwrap()),
        text("a sweep of no tasks", "sweep plan p.toml -o out", "p.toml", NO_TASKS),
        text("no TOML", "refine study.toml -o out", "study.toml", "system := m\n"),
        text("a problem without a system", "optimize p.toml -o out", "p.toml", "[solver]\n"),
        text(
            "4,096 lists inside of each other",
            "optimize p.toml -o out",
            "p.toml",
            &format!("a = {}{}\n", "[".repeat(4096), "]".repeat(4096)),
        ),
    ]
}
