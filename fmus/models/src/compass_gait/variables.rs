//! The variables of the walker, with units and ranges.

use super::body::{Body, Pose};
use super::feet::Feet;
use fmi_export::{Boolean, Integer, MemoryBlock, Real, Scalar, Table, Values};

/// Outputs of one foot.
#[derive(Clone, Copy)]
pub struct Foot {
    pub position: [Real; 2],
    pub velocity: [Real; 2],
    pub acceleration: [Real; 2],
    pub force: [Real; 2],
    /// Impulse of the last impact.
    pub last_impulse: [Real; 2],
    /// Impulse of the impact that `impact_map` asks for.
    pub impulse: [Real; 2],
    pub slides: Boolean,
}

/// Handles of all variables and of the memory.
pub struct Variables {
    pub inputs: [Real; 3],
    pub q: [Real; 6],
    pub v: [Real; 6],
    pub der_q: [Real; 6],
    pub der_v: [Real; 6],
    pub feet: [Foot; 2],
    pub mode: Integer,
    pub fallen: Boolean,
    pub energy: Real,
    pub impacts: Integer,
    pub last_impact_time: Real,
    pub after: [Real; 6],
    pub contact_mode: Integer,
    pub impact_map: Integer,
    pub on_slide: Integer,
    pub on_fall: Integer,
    pub masses: [Real; 11],
    pub friction: Real,
    pub slide_tolerance: Real,
    pub fall_height: Real,
    pub memory: Memories,
}

/// Numbers that change at events.
pub struct Memories {
    /// Feet on the ground, as [`Feet::number`].
    pub feet: MemoryBlock,
    /// 1: the foot has risen since it left the ground, so the next touch is an impact.
    pub risen: MemoryBlock,
    /// 1: the foot's force has left the friction cone since it came to the ground.
    pub slides: MemoryBlock,
    /// 1: the hip has come below `fall_height`.
    pub fallen: MemoryBlock,
    /// 1 until the first event has looked at the start.
    pub fresh: MemoryBlock,
    /// Impulses of the last impact: foot 1 tangential and normal, foot 2 tangential and normal.
    pub impulses: MemoryBlock,
    /// Time and number of impacts.
    pub impacts: MemoryBlock,
    /// Kind of the last event: sum of the codes in [`super::events`].
    pub note: MemoryBlock,
}

/// Smallest mass \[kg\] and inertia \[kg m²\]: the mass matrix stays regular.
const MIN_MASS_OR_INERTIA: f64 = 1e-9;

const COORDINATES: [(&str, &str, &str, f64); 6] = [
    ("x", "m", "horizontal position of the hip", 0.0),
    ("y", "m", "height of the hip", 1.045),
    ("th1", "rad", "angle of leg 1, 0 vertical, positive: the foot is ahead of the hip", 0.0),
    ("th2", "rad", "angle of leg 2", 0.0),
    ("l1", "m", "length of leg 1 from hip to tip", 1.045),
    ("l2", "m", "length of leg 2 from hip to tip", 1.0),
];
const RATES: [(&str, &str, &str); 6] = [
    ("vx", "m/s", "horizontal velocity of the hip"),
    ("vy", "m/s", "vertical velocity of the hip"),
    ("omega1", "rad/s", "angular velocity of leg 1"),
    ("omega2", "rad/s", "angular velocity of leg 2"),
    ("dl1", "m/s", "rate of l1"),
    ("dl2", "m/s", "rate of l2"),
];
const ACCELERATIONS: [(&str, &str, &str); 6] = [
    ("ax", "m/s2", "horizontal acceleration of the hip"),
    ("ay", "m/s2", "vertical acceleration of the hip"),
    ("alpha1", "rad/s2", "angular acceleration of leg 1"),
    ("alpha2", "rad/s2", "angular acceleration of leg 2"),
    ("ddl1", "m/s2", "second derivative of l1"),
    ("ddl2", "m/s2", "second derivative of l2"),
];
const BODY: [(&str, &str, &str, f64, f64); 11] = [
    ("m3", "kg", "mass of the trunk (W-1)", 0.0, 6.0),
    ("d", "m", "center of the trunk above the hip (W-1)", 0.0, 0.10),
    ("I3", "kg.m2", "inertia of the trunk about its center (W-1)", 0.0, 0.10),
    ("mu", "kg", "mass of an upper leg (W-2)", MIN_MASS_OR_INERTIA, 3.7),
    ("a", "m", "center of an upper leg below the hip (W-2)", 0.0, 0.35),
    ("Iu", "kg.m2", "inertia of an upper leg about its center (W-2)", MIN_MASS_OR_INERTIA, 0.20),
    ("mt", "kg", "mass of a toe (W-3)", MIN_MASS_OR_INERTIA, 0.8),
    ("c", "m", "center of a toe above its tip (W-3)", 0.0, 0.10),
    ("It", "kg.m2", "inertia of a toe about its center (W-3)", 0.0, 0.005),
    ("Ir", "kg.m2", "reflected rotor inertia on th2' - th1' (W-4), 0: none", 0.0, 0.05),
    ("g", "m/s2", "gravity (W-5)", 0.0, 9.81),
];
const MODES: [(&str, &str); 4] = [
    ("flight", "neither foot on the ground"),
    ("foot1", "foot 1 on the ground"),
    ("foot2", "foot 2 on the ground"),
    ("both", "both feet on the ground"),
];
const PINNED: [(&str, &str); 5] =
    [("events", "events change the mode: touch-down, lift-off"), MODES[0], MODES[1], MODES[2], MODES[3]];
const MAPS: [(&str, &str); 4] = [
    ("none", "no impact: velocities as they are"),
    ("foot1", "foot 1 comes to rest, foot 2 is free"),
    ("foot2", "foot 2 comes to rest, foot 1 is free"),
    ("both", "both feet come to rest"),
];
const REACTIONS: [(&str, &str); 2] = [
    ("stop", "end the simulation, with a message"),
    ("mark", "say so in an output and go on as if nothing had happened"),
];

impl Variables {
    pub fn declare(t: &mut Table) -> Self {
        t.unit("kg.m2", &[("kg", 1), ("m", 2)]);
        t.unit("N.s", &[("kg", 1), ("m", 1), ("s", -1)]);
        // At the start values these forces hold the robot on foot 1.
        let inputs = [
            t.input("tau").unit("N.m").about("hip torque, conjugate to th2 - th1").nominal(10.0).real(0.0),
            t.input("F1").unit("N").about("toe force that extends leg 1").nominal(100.0).real(139.302),
            t.input("F2").unit("N").about("toe force that extends leg 2").nominal(100.0).real(-7.848),
        ];
        let q = COORDINATES.map(|(name, unit, about, start)| {
            t.state(name).unit(unit).about(about).nominal(0.1).output().reinit().real(start)
        });
        let v = RATES
            .map(|(name, unit, about)| t.state(name).unit(unit).about(about).output().reinit().real(0.0));
        let der_q = std::array::from_fn(|i| {
            let name = COORDINATES[i].0;
            t.derivative(format!("der({name})"), q[i])
                .unit(RATES[i].1)
                .about(format!("rate of {name}"))
                .computed()
        });
        let der_v = std::array::from_fn(|i| {
            let (name, unit, about) = ACCELERATIONS[i];
            t.derivative(name, v[i]).unit(unit).about(about).nominal(10.0).output().computed()
        });
        let feet = [1, 2].map(|i| Foot::declare(t, i));
        let modes = t.enumeration("ContactMode", &MODES);
        let pinned = t.enumeration("PinnedContactMode", &PINNED);
        let maps = t.enumeration("ImpactMap", &MAPS);
        let reactions = t.enumeration("Reaction", &REACTIONS);
        let mode = t.output("mode").about("feet on the ground").computed_enumeration(modes);
        let fallen = t.output("fallen").about("the hip has come below fall_height").computed_boolean();
        let energy = t
            .output("energy")
            .unit("J")
            .about("kinetic and potential energy, masses at height 0 as zero")
            .nominal(100.0)
            .computed();
        let impacts = t.output("impact.count").about("impacts so far").computed_integer();
        let last_impact_time =
            t.output("impact.time").unit("s").about("time of the last impact").discrete().computed();
        let after = std::array::from_fn(|i| {
            let (name, unit, about) = RATES[i];
            t.output(format!("after.{name}"))
                .unit(unit)
                .about(format!("{about} after the impact of impact_map"))
                .computed()
        });
        let contact_mode = t
            .parameter("contact_mode")
            .about("how the mode is found: by events, or pinned (then there are no events)")
            .enumeration_of(pinned, 1);
        let impact_map = t
            .parameter("impact_map")
            .about("which feet hold in the impact that `after` shows")
            .enumeration_of(maps, 1);
        let on_slide = t
            .parameter("on_slide")
            .about("what to do when a foot's force leaves the friction cone")
            .enumeration_of(reactions, 1);
        let on_fall = t.parameter("on_fall").about("what to do on a fall").enumeration_of(reactions, 1);
        let masses = BODY.map(|(name, unit, about, low, start)| {
            t.parameter(name).unit(unit).about(about).min(low).nominal(start).real(start)
        });
        let friction = t
            .parameter("mu_friction")
            .about("friction coefficient of the feet (W-13)")
            .min(0.0)
            .nominal(0.6)
            .real(0.6);
        let slide_tolerance = t
            .parameter("slide_tolerance")
            .unit("N")
            .about("how far the tangential force may leave the friction cone")
            .min(0.0)
            .nominal(0.1)
            .real(0.1);
        let fall_height =
            t.parameter("fall_height").unit("m").about("height of the hip at which it is a fall").real(0.5);
        let memory = Memories {
            feet: t.memory(1),
            risen: t.memory(2),
            slides: t.memory(2),
            fallen: t.memory(1),
            fresh: t.memory(1),
            impulses: t.memory(4),
            impacts: t.memory(2),
            note: t.memory(1),
        };
        t.event_indicators(super::events::INDICATORS);
        Self {
            inputs,
            q,
            v,
            der_q,
            der_v,
            feet,
            mode,
            fallen,
            energy,
            impacts,
            last_impact_time,
            after,
            contact_mode,
            impact_map,
            on_slide,
            on_fall,
            masses,
            friction,
            slide_tolerance,
            fall_height,
            memory,
        }
    }

    /// Mode that a parameter pins; none where events change it.
    pub fn pinned<S: Scalar>(&self, q: &Values<S>) -> Option<Feet> {
        (q[self.contact_mode] > 1).then(|| Feet::from_number(q[self.contact_mode] - 2))
    }

    /// Feet on the ground.
    pub fn feet_down<S: Scalar>(&self, q: &Values<S>) -> Feet {
        self.pinned(q).unwrap_or_else(|| Feet::from_number(q[self.memory.feet.at(0)].value() as i32))
    }

    /// Feet that hold in the impact that `after` shows.
    pub fn mapped_feet<S: Scalar>(&self, q: &Values<S>) -> Feet {
        Feet::from_number(q[self.impact_map] - 1)
    }

    /// Masses and lengths.
    pub fn body<S: Scalar>(&self, q: &Values<S>) -> Body<S> {
        let [m3, d, i3, mu, a, iu, mt, c, it, ir, g] = self.masses.map(|h| q[h]);
        Body { m3, d, i3, mu, a, iu, mt, c, it, ir, g }
    }

    /// Position and velocity.
    pub fn pose<S: Scalar>(&self, q: &Values<S>) -> Pose<S> {
        Pose::new(self.q.map(|h| q[h]), self.v.map(|h| q[h]))
    }
}

impl Foot {
    fn declare(t: &mut Table, i: usize) -> Self {
        let mut pair =
            |group: &str, names: [&str; 2], unit: &'static str, about: [&str; 2], discrete: bool| {
                std::array::from_fn(|k| {
                    let d = t
                        .output(format!("{group}{}", names[k]))
                        .unit(unit)
                        .about(format!("{} {i}", about[k]));
                    if discrete { d.discrete().computed() } else { d.computed() }
                })
            };
        let foot = format!("foot{i}.");
        Self {
            position: pair(&foot, ["x", "y"], "m", ["horizontal position of foot", "height of foot"], false),
            velocity: pair(
                &foot,
                ["vx", "vy"],
                "m/s",
                ["horizontal velocity of foot", "vertical velocity of foot"],
                false,
            ),
            acceleration: pair(
                &foot,
                ["ax", "ay"],
                "m/s2",
                ["horizontal acceleration of foot", "vertical acceleration of foot"],
                false,
            ),
            force: pair(
                &foot,
                ["ft", "fn"],
                "N",
                ["tangential force of the ground on foot", "normal force of the ground on foot"],
                false,
            ),
            last_impulse: pair(
                &format!("impact.foot{i}."),
                ["Lt", "Ln"],
                "N.s",
                [
                    "tangential impulse of the last impact on foot",
                    "normal impulse of the last impact on foot",
                ],
                true,
            ),
            impulse: pair(
                &format!("after.foot{i}."),
                ["Lt", "Ln"],
                "N.s",
                [
                    "tangential impulse of the impact of impact_map on foot",
                    "normal impulse of the impact of impact_map on foot",
                ],
                false,
            ),
            slides: t
                .output(format!("foot{i}.slides"))
                .about(format!(
                    "the force has left the friction cone since foot {i} came down; the foot is held"
                ))
                .computed_boolean(),
        }
    }
}
