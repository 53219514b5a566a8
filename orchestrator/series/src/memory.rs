//! Memory of the computer.

/// Memory that is free \[bytes\]; where the system does not say, without end.
pub fn free() -> f64 {
    let text = std::fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"));
    let kib = line.and_then(|line| line.trim().strip_suffix("kB")?.trim().parse::<f64>().ok());
    kib.map_or(f64::INFINITY, |kib| 1024.0 * kib)
}
