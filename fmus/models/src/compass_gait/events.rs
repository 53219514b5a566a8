//! Events of the walker: changes of mode and their consequences.
//!
//! A foot in the air comes down where its height falls through 0. A foot that has just left the ground has height 0 and
//! is not told apart from one that lands by its height: until it has risen by [`MIN_HEIGHT_IN_AIR`], it comes back
//! where its vertical velocity turns, without an impact worth the name, and at the latest where it has sunk by
//! [`MAX_DEPTH_NOT_RISEN`]. A foot on the ground leaves it where its normal force falls below [`LIFT_OFF_FORCE`], also
//! with a tangential force left that lets it sink at first: sliding is not modeled.

use super::contact::{Mechanics, OnFeet};
use super::feet::Feet;
use super::variables::Variables;
use fmi_export::{Event, Outcome, Refusal, Scalar, Values};

/// Normal force \[N\] at which a foot lifts off, and normal impulse \[N s\] at which one is pulled off by an impact.
const LIFT_OFF_FORCE: f64 = -1e-7;
const LIFT_OFF_IMPULSE: f64 = -1e-9;
/// Height \[m\] above which a foot that left the ground counts as in the air.
const MIN_HEIGHT_IN_AIR: f64 = 1e-9;
/// Depth \[m\] at which a foot that has not risen is caught.
const MAX_DEPTH_NOT_RISEN: f64 = 1e-6;
/// Largest distance from the ground \[m\] and from rest \[m/s\] of a foot that stands at the start.
const START_TOLERANCE: f64 = 1e-6;
/// Three per foot, and the fall.
pub const INDICATORS: usize = 7;
/// An indicator of something that cannot happen in the present mode.
const INDICATOR_OF_NOTHING: f64 = 1.0;

/// Codes of what an event was; those of foot 2 are twice those of foot 1.
const LANDED: i32 = 1;
const LIFTED: i32 = 4;
const SLID: i32 = 16;
const PULLED: i32 = 64;
const FELL: i32 = 256;
const SINGULAR: i32 = 512;

/// Mode at the start, from heights and velocities of the feet.
pub fn initialize<S: Scalar>(k: &Variables, q: &mut Values<S>) -> Outcome {
    let m = &k.memory;
    for block in [m.feet, m.risen, m.slides, m.fallen, m.impulses, m.impacts, m.note] {
        (0..block.len()).for_each(|i| q[block.at(i)] = S::zero());
    }
    q[m.fresh.at(0)] = S::from(1.0);
    if k.pinned(q).is_some() {
        return Ok(());
    }
    let pose = k.pose(q);
    let mut down = Feet::NONE;
    for i in 0..2 {
        let height = pose.foot(i)[1].value();
        let [vx, vy] = pose.foot_rate(i, &pose.v).map(S::value);
        if height < -START_TOLERANCE {
            return Err(Refusal::Error(format!(
                "foot {} starts at y = {height} m, below the ground at 0; raise y or shorten l{}",
                i + 1,
                i + 1
            )));
        }
        if height > START_TOLERANCE {
            q[m.risen.at(i)] = S::from(1.0);
        } else if vy.abs() <= START_TOLERANCE {
            if vx.abs() > START_TOLERANCE {
                return Err(Refusal::Error(format!(
                    "foot {} starts on the ground and moves along it at {vx} m/s; no sliding is modeled: start it at \
                     rest or above the ground",
                    i + 1
                )));
            }
            down = down.with(Feet::only(i));
        } else if vy < 0.0 {
            q[m.risen.at(i)] = S::from(1.0);
        }
    }
    q[m.feet.at(0)] = S::from(f64::from(down.number()));
    Ok(())
}

/// Indicators that fall to 0 where the mode may change; evaluated after the equations.
pub fn indicators(k: &Variables, q: &Values<f64>, z: &mut [f64]) {
    z.fill(INDICATOR_OF_NOTHING);
    if k.pinned(q).is_some() {
        return;
    }
    let down = k.feet_down(q);
    for (i, foot) in k.feet.iter().enumerate() {
        let z = &mut z[3 * i..3 * i + 3];
        let risen = q[k.memory.risen.at(i)] > 0.0;
        let height = q[foot.position[1]];
        if down.contains(i) {
            z[0] = q[foot.force[1]] - LIFT_OFF_FORCE;
            if q[k.memory.slides.at(i)] == 0.0 {
                z[2] = cone_margin(k, q, q[foot.force[0]], q[foot.force[1]]);
            }
        } else if risen {
            z[0] = height;
        } else {
            z[0] = q[foot.velocity[1]];
            z[1] = (MIN_HEIGHT_IN_AIR - height) * (height + MAX_DEPTH_NOT_RISEN);
        }
    }
    if q[k.memory.fallen.at(0)] == 0.0 {
        z[6] = q[k.q[1]] - q[k.fall_height];
    }
}

/// Distance of a force from the boundary of the friction cone \[N\], positive inside, with the tolerance.
fn cone_margin(k: &Variables, q: &Values<f64>, tangential: f64, normal: f64) -> f64 {
    q[k.friction] * normal.max(0.0) + q[k.slide_tolerance] - tangential.abs()
}

/// True where an event is due now without a change of sign: at the start, and where an input jumped at a communication
/// point so that a foot would be pulled or would slide.
pub fn pending(k: &Variables, q: &Values<f64>) -> bool {
    if k.pinned(q).is_some() {
        return false;
    }
    if q[k.memory.fresh.at(0)] > 0.0 {
        return true;
    }
    let down = k.feet_down(q);
    let motion = Mechanics::new(k.body(q), k.pose(q)).and_then(|m| m.motion(k.inputs.map(|h| q[h]), down));
    motion.is_ok_and(|(_, forces)| {
        down.iter().any(|i| {
            let [tangential, normal] = forces[i];
            let slides = cone_margin(k, q, tangential, normal) <= 0.0 && q[k.memory.slides.at(i)] == 0.0;
            normal < LIFT_OFF_FORCE || slides
        })
    })
}

/// Brings the mode up to date with position, velocity and forces; does nothing where no condition holds.
pub fn handle(k: &Variables, q: &mut Values<f64>) -> Event {
    if k.pinned(q).is_some() {
        return Event::default();
    }
    q[k.memory.fresh.at(0)] = 0.0;
    let mut codes = 0;
    let states_changed = land(k, q, &mut codes);
    settle(k, q, &mut codes);
    if q[k.memory.fallen.at(0)] == 0.0 && q[k.q[1]] <= q[k.fall_height] {
        q[k.memory.fallen.at(0)] = 1.0;
        codes |= FELL;
    }
    q[k.memory.note.at(0)] = f64::from(codes);
    let stop = |reaction, codes: i32, of: i32| q[reaction] == 1 && codes & of != 0;
    let terminate =
        stop(k.on_slide, codes, 3 * (SLID | PULLED)) || stop(k.on_fall, codes, FELL) || codes & SINGULAR != 0;
    Event { states_changed, iterate: false, terminate }
}

/// Impact of the feet that come down now; true where velocities changed.
fn land(k: &Variables, q: &mut Values<f64>, codes: &mut i32) -> bool {
    let (pose, down) = (k.pose(q), k.feet_down(q));
    let mut landing = Feet::NONE;
    for i in (0..2).filter(|i| !down.contains(*i)) {
        let (height, falling) = (pose.foot(i)[1], pose.foot_rate(i, &pose.v)[1] < 0.0);
        let ground = if q[k.memory.risen.at(i)] > 0.0 { 0.0 } else { -MAX_DEPTH_NOT_RISEN };
        if height <= ground && falling {
            landing = landing.with(Feet::only(i));
        } else if height > MIN_HEIGHT_IN_AIR {
            q[k.memory.risen.at(i)] = 1.0;
        }
    }
    if landing.is_empty() {
        return false;
    }
    let Ok(mechanics) = Mechanics::new(k.body(q), pose) else {
        *codes |= SINGULAR;
        return false;
    };
    let Some((velocities, impulses, held)) = impact(&mechanics, down, landing) else {
        *codes |= SINGULAR;
        return false;
    };
    for i in held.iter() {
        if impulses[i][1] < LIFT_OFF_IMPULSE {
            *codes |= PULLED << i;
        }
    }
    for i in landing.iter().filter(|i| held.contains(*i)) {
        *codes |= LANDED << i;
        q[k.memory.slides.at(i)] = 0.0;
    }
    for i in down.without(held).iter() {
        *codes |= LIFTED << i;
        q[k.memory.risen.at(i)] = 0.0;
    }
    q[k.memory.feet.at(0)] = f64::from(held.number());
    for (handle, velocity) in k.v.iter().zip(velocities) {
        q[*handle] = velocity;
    }
    for (i, impulse) in impulses.iter().flatten().enumerate() {
        q[k.memory.impulses.at(i)] = *impulse;
    }
    q[k.memory.impacts.at(0)] = q.time;
    q[k.memory.impacts.at(1)] += 1.0;
    true
}

/// All feet hold; those whose impulse would pull are let go, first the feet that stood before. Velocities, impulses and
/// the feet that hold.
fn impact(mechanics: &Mechanics<f64>, down: Feet, landing: Feet) -> Option<([f64; 6], OnFeet<f64>, Feet)> {
    let mut held = down.with(landing);
    loop {
        let (velocities, impulses) = mechanics.impact(held).ok()?;
        let pulled = |i: &usize| impulses[*i][1] < LIFT_OFF_IMPULSE;
        let stood = down.iter().filter(|i| held.contains(*i)).find(pulled);
        let Some(i) = stood.or_else(|| (held == Feet::BOTH).then(|| held.iter().find(pulled)).flatten())
        else {
            return Some((velocities, impulses, held));
        };
        held = held.without(Feet::only(i));
    }
}

/// Lets feet go that would pull, takes feet back that have not risen and would sink, and looks at the friction cones.
fn settle(k: &Variables, q: &mut Values<f64>, codes: &mut i32) {
    let inputs = k.inputs.map(|h| q[h]);
    let mut lifted = Feet::NONE;
    // Each round changes one foot; a foot that was let go is not taken back in the same event.
    for _ in 0..4 {
        let (pose, down) = (k.pose(q), k.feet_down(q));
        let motion = Mechanics::new(k.body(q), pose).and_then(|m| m.motion(inputs, down));
        let Ok((accelerations, forces)) = motion else {
            *codes |= SINGULAR;
            return;
        };
        let weakest = down.iter().min_by(|a, b| forces[*a][1].total_cmp(&forces[*b][1]));
        if let Some(i) = weakest.filter(|i| forces[*i][1] < LIFT_OFF_FORCE) {
            q[k.memory.feet.at(0)] = f64::from(down.without(Feet::only(i)).number());
            q[k.memory.risen.at(i)] = 0.0;
            *codes |= LIFTED << i;
            lifted = lifted.with(Feet::only(i));
            continue;
        }
        let sinks = |i: &usize| {
            let acceleration = pose.foot_rate(*i, &accelerations)[1] + pose.foot_drift(*i)[1];
            let falling = pose.foot_rate(*i, &pose.v)[1] <= 0.0;
            !down.with(lifted).contains(*i)
                && q[k.memory.risen.at(*i)] == 0.0
                && falling
                && acceleration < 0.0
        };
        if let Some(i) = (0..2).find(sinks) {
            q[k.memory.feet.at(0)] = f64::from(down.with(Feet::only(i)).number());
            q[k.memory.slides.at(i)] = 0.0;
            *codes |= LANDED << i;
            continue;
        }
        for i in down.iter() {
            let outside = cone_margin(k, q, forces[i][0], forces[i][1]) <= 0.0;
            if outside && q[k.memory.slides.at(i)] == 0.0 {
                q[k.memory.slides.at(i)] = 1.0;
                *codes |= SLID << i;
            }
        }
        return;
    }
}

/// The last event in words.
pub fn explain(k: &Variables, q: &Values<f64>) -> Option<String> {
    let codes = q[k.memory.note.at(0)] as i32;
    let mut parts = Vec::new();
    for i in 0..2 {
        let foot = format!("foot {}", i + 1);
        if codes & LANDED << i != 0 {
            parts.push(format!("{foot} came down"));
        }
        if codes & LIFTED << i != 0 {
            parts.push(format!("{foot} lifted off"));
        }
        if codes & SLID << i != 0 {
            parts.push(format!(
                "{foot} would slide: the ground would have to hold more than mu_friction = {} times the normal force; \
                 no sliding is modeled (on_slide = mark goes on with the foot held)",
                q[k.friction]
            ));
        }
        if codes & PULLED << i != 0 {
            parts.push(format!(
                "the ground would have to pull at {foot} in the impact; no contact law of this model holds there"
            ));
        }
    }
    if codes & FELL != 0 {
        parts.push(format!("the walker fell: the hip is below fall_height = {} m", q[k.fall_height]));
    }
    if codes & SINGULAR != 0 {
        parts.push("the contact is singular: a leg has no length".into());
    }
    (!parts.is_empty()).then(|| parts.join("; "))
}
