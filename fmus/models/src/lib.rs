//! Equations of the airloop models.
//!
//! One module per model; [`registry`] lists them. What FMI needs of them (interfaces, states of an instance,
//! XML) is in `fmi-export`, what makes an `.fmu` of them in `packager`.
//!
//! Notation of the paper, *Model-based Trajectory Control of Robots with Pneumatic Actuator Dynamics*;
//! plain equation, section and figure numbers in this crate are those of the paper.
//!
//! | paper | code | unit | meaning | equation |
//! |---|---|---|---|---|
//! | u | `u` | N | force command | 3, 6 |
//! | p₁, p₂ | `p1`, `p2` | Pa | commanded chamber pressures | 3 |
//! | S₁, S₂ | `S1`, `S2` | m² | sectional areas of the chambers | 3, 5 |
//! | F_eq | `F_eq` | N | bias force | 3 |
//! | F̂_p | `F_hat` | N | force of the pressure difference | 5 |
//! | F_p | `F_act` | N | second output of the identified actuator (rod fixed) | 5-8, 12 |
//! | A₁ ... | `A1[i,j]` ... `A4[i,j]` | 1 | coefficients on past outputs | 6, 7 |
//! | B₀, B₁ ... | `B0[i]` ... `B4[i]` | 1 | coefficients on commands | 6, 7 |
//! | n_k | `nk` | 1 | input delay in samples | 6 |
//! | f | `f` | N | friction force | 2, 10, 11 |
//! | c₁ ... c₅ | `c1` ... `c5` | N, s/m, m/s, N s/m, N | friction coefficients | 2, 10, 11 |
//! | x, θ | `x`, `theta` | m, rad | cart position, pole angle (0 hanging, counter-clockwise) | 4 |
//! | ẋ, θ̇ | `v`, `omega` | m/s, rad/s | their rates | 4 |
//! | ẍ, θ̈ | `a`, `alpha` | m/s², rad/s² | their accelerations | 4 |
//! | m_c, m_p | `m_c`, `m_p` | kg | mass of the cart, of the pole | 4 |
//! | l | `l` | m | pole length to its point mass | 4 |
//! | g | `g` | m/s² | gravity | 4 |
//! | b_p | `b_p` | N m s/rad | damping of the pole's joint | 4 |
//! | θ₁, θ₂, l₁, l₂ | `th1`, `th2`, `l1`, `l2` | rad, m | legs of the walker: angles, lengths from hip to tip | 1, 3 |
//!
//! The paper's F_p is the load cell between rod and cart. With the rod fixed that is the actuator's output
//! (`F_act`); with a moving rod it is the output of the piston's friction block.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod arx_actuator;
mod cart_pole;
mod compass_gait;
mod continuous_form;
mod effect;
mod friction;
mod linear_state_space;
mod matrix;
mod pendulum;
mod piston_force;
mod pneumatic_cylinder;
pub mod registry;
mod rigid_mass;
pub mod testing;
mod tvlqr_controller;

pub use arx_actuator::ArxActuator;
pub use cart_pole::CartPole;
pub use compass_gait::CompassGait;
pub use effect::{ExpressionEffect, ForceEffect, PortEffect, SensorEffect, SignalEffect, TorqueEffect};
pub use friction::Friction;
pub use linear_state_space::LinearStateSpace;
pub use pendulum::Pendulum;
pub use piston_force::PistonForce;
pub use pneumatic_cylinder::PneumaticCylinder;
pub use rigid_mass::RigidMass;
pub use tvlqr_controller::TvlqrController;

/// Attributes that every model has in common.
const GENERATION_TOOL: &str = "airloop fmi-export";
const AUTHOR: &str = "airloop developers";
const VERSION: &str = env!("CARGO_PKG_VERSION");
