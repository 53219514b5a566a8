use super::*;
use sensor::{Sensor, measure, quantize};

fn recording() -> Recording {
    let n = 20_000;
    let mut signals = TimeSeries::new(airloop_ident::excite::times(n, 1e-3)).unwrap();
    signals.push("u", Some("N".into()), vec![1.25; n]).unwrap();
    signals.push("F_p", Some("N".into()), vec![2.0; n]).unwrap();
    Recording { name: "a.csv".into(), estimation: true, experiment: "rod_fixed", group: "a".into(), signals }
}

#[test]
fn noise_has_its_size_and_commands_stay_exact() {
    let measured = measure(&recording(), &[], 7).unwrap();
    assert!(measured.channel("u").unwrap().values.iter().all(|u| *u == 1.25));
    let force = &measured.channel("F_p").unwrap().values;
    let rms = (force.iter().map(|f| (f - 2.0).powi(2)).sum::<f64>() / force.len() as f64).sqrt();
    // Four standard deviations of an rms of 20000 samples are 2 %.
    assert!((rms / 0.3 - 1.0).abs() < 0.02, "{rms}");
    assert!(force.iter().all(|f| (f * 100.0 - (f * 100.0).round()).abs() < 1e-9));
}

#[test]
fn the_same_seed_gives_the_same_record_and_signals_do_not_share_noise() {
    let sensors = [Sensor { signal: "u".into(), noise: 0.3, step: 0.0 }];
    let (a, b) = (measure(&recording(), &sensors, 7).unwrap(), measure(&recording(), &sensors, 7).unwrap());
    assert_eq!(a, b);
    assert_ne!(a, measure(&recording(), &sensors, 8).unwrap());
    let (u, f) = (&a.channels()[0].values, &a.channels()[1].values);
    let product: f64 = u.iter().zip(f).map(|(u, f)| (u - 1.25) * (f - 2.0)).sum();
    let correlation = product / (0.09 * u.len() as f64);
    assert!(correlation.abs() < 0.03, "{correlation}");
    let lost = [Sensor { signal: "p".into(), noise: 0.0, step: 0.0 }];
    assert!(sensor::check(&[recording()], &lost).unwrap_err().to_string().contains("F_p, u"));
}

#[test]
fn quantized_values_are_short_numbers() {
    assert_eq!(quantize(0.123456, 1e-3), 0.123);
    assert_eq!(quantize(-2.3449, 0.01), -2.34);
    assert_eq!(quantize(0.1, 0.0), 0.1);
}

#[test]
fn the_case_lists_sensors_and_files() {
    let text = case::text("a", "actuator", "x.fmu", 1, 1e-3, &[], &[recording()]);
    let table: toml::Table = text.parse().unwrap();
    assert_eq!(
        table["sample_rate_hz"].as_float().or(table["sample_rate_hz"].as_integer().map(|i| i as f64)),
        Some(1000.0)
    );
    assert_eq!(table["sensors"]["F_p"]["noise_rms"].as_float(), Some(0.3));
    assert_eq!(table["files"][0]["role"].as_str(), Some("estimation"));
}
