//! Initial guesses of the parameters of laws, from what the records moved through.

use super::law::Law;

/// Steps of a rounded value between zero and its largest that are looked for at most: finer ones are next to noise.
const MAX_LEVELS: f64 = 16.0;
/// Periods within the travel up to which all are starts; shorter ones are proposed by [`super::periods`].
const MAX_TURNS: f64 = 25.0;
/// The same for friction that repeats: once a revolution, or a few times along a guide.
const MAX_TURNS_OF_FRICTION: f64 = 8.0;
/// Difference of the numbers of periods of neighbors: a third of a turn over the travel.
pub(super) const STEP_OF_TURNS: f64 = 0.35;
/// Difference between starts in such steps: rounding to one of them and to the next have little in common.
const LEVELS_BETWEEN_STARTS: f64 = 0.4;

/// Points to start from, `[points][count]` in the units of the port, zeros where the linear step finds the value.
///
/// `ranges`: least and largest velocity, position, pressure force, pressure, and value that passes, on the estimation
/// records; `count`: parameters; `duration`: of the longest record \[s\].
///
/// # Errors
/// Why the records do not excite the law.
pub(super) fn initial_guesses(
    law: Law,
    count: usize,
    (ranges, duration): (&[(f64, f64); 5], f64),
) -> Result<Vec<Vec<f64>>, &'static str> {
    let [velocity, position, pressure_force, pressure, value] = *ranges;
    let width = |range: (f64, f64)| range.1 - range.0;
    let size = |range: (f64, f64)| range.0.abs().max(range.1.abs());
    let (v, x) = (size(velocity), width(position));
    let needs_motion = "nothing moves in the estimation records, or no velocity is known at the attachment";
    let needs_position =
        "the position does not change in the estimation records, or none is known at the attachment";
    match law {
        Law::Viscous | Law::Coulomb | Law::Drag | Law::Asymmetry | Law::Stribeck | Law::Presliding
            if v <= 0.0 =>
        {
            return Err(needs_motion);
        }
        Law::PositionCoulomb | Law::PeriodicCoulomb | Law::Cogging if v <= 0.0 || x <= 0.0 => {
            return Err(needs_position);
        }
        Law::Spring | Law::EndStop | Law::LowerStop | Law::PositionGain | Law::CubicSpring if x <= 0.0 => {
            return Err(needs_position);
        }
        Law::Leakage | Law::Outlet | Law::Overflow | Law::CaughtOverflow | Law::Choked if x <= 0.0 => {
            return Err("the level does not change in the estimation records, or none is known at the port");
        }
        Law::Outlet | Law::Overflow | Law::CaughtOverflow if position.0 < -0.01 * x || position.1 <= 0.0 => {
            return Err("the position at its port is below zero at times, so that it is no level");
        }
        Law::Choked if position.0 <= 0.0 => {
            return Err("the pressure is not above zero at all times, so that it is no absolute one");
        }
        Law::Pressure if v <= 0.0 || width(pressure_force) <= 0.1 * size(pressure_force) => {
            return Err("the pressure force hardly changes, or none is known at the attachment");
        }
        Law::Load if v <= 0.0 || width(value) <= 0.1 * size(value) => {
            return Err("the load that passes the port hardly changes, or nothing moves");
        }
        Law::Area if width(pressure) <= 0.1 * size(pressure) => {
            return Err("the pressure hardly changes, or none is known at the attachment");
        }
        Law::Gain | Law::DeadBand | Law::Saturation | Law::Limits | Law::Quantization | Law::Droop
            if width(value) <= 0.0 =>
        {
            return Err("the value does not change");
        }
        _ => {}
    }
    Ok(match law {
        Law::Coulomb | Law::Load if count == 2 => [0.005, 0.03].map(|part| vec![0.0, part * v]).into(),
        Law::CubicSpring => {
            let middle = 0.5 * (position.0 + position.1);
            let slack = if position.0 < 0.0 && position.1 > 0.0 { 1e-3 * x } else { middle };
            [slack, middle + 1e-3 * x].map(|rest| vec![0.0, rest]).into()
        }
        Law::Overflow => [0.4, 0.6, 0.75, 0.9].map(|part| vec![0.0, position.0 + part * x]).into(),
        Law::CaughtOverflow => [0.4, 0.6, 0.75, 0.9].map(|part| vec![0.0, position.0 + part * x, 0.0]).into(),
        Law::Stribeck => [0.02, 0.06, 0.2].map(|part| vec![0.0, part * v]).into(),
        Law::Presliding => {
            let travel = if x > 0.0 { x } else { v };
            [1e-4, 1e-3, 5e-3, 2e-2].map(|part| vec![part * travel]).into()
        }
        Law::Droop => [0.03, 0.1, 0.3].map(|part| vec![0.0, part * duration]).into(),
        Law::DeadBand => [0.02, 0.1].map(|part| vec![part * size(value)]).into(),
        Law::Saturation => [0.95, 0.8, 0.6].map(|part| vec![part * size(value)]).into(),
        Law::Quantization => {
            let count = (MAX_LEVELS / LEVELS_BETWEEN_STARTS) as usize;
            let levels = |k: usize| 1.0 + LEVELS_BETWEEN_STARTS * k as f64;
            (0..count).map(|k| vec![size(value) / levels(k)]).collect()
        }
        Law::Limits => {
            let part = |part: f64| value.0 + part * width(value);
            [(0.02, 0.8), (0.1, 0.9), (0.2, 0.98)].map(|(low, high)| vec![part(low), part(high)]).into()
        }
        Law::Choked => [0.3, 0.6, 0.9].map(|part| vec![0.0, part * position.1]).into(),
        Law::LowerStop => {
            let inside = [0.5, 0.3, 0.18, 0.1, 0.04];
            inside.map(|part| vec![0.0, 0.0, position.0 + part * x]).into()
        }
        Law::EndStop => {
            let inside = [0.5, 0.7, 0.82, 0.9, 0.96];
            inside.map(|part| vec![0.0, 0.0, position.0 + part * x]).into()
        }
        Law::Cogging | Law::PeriodicCoulomb => {
            let most = if law == Law::Cogging { MAX_TURNS } else { MAX_TURNS_OF_FRICTION };
            let mut grid = Vec::new();
            let mut period = x;
            while period > x / most {
                grid.push(vec![0.0, 0.0, period]);
                period = 1.0 / (1.0 / period + STEP_OF_TURNS / x);
            }
            grid
        }
        law => vec![vec![0.0; law.parameters()]],
    })
}
