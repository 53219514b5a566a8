//! The parameters of the cylinder, with units and ranges.

use fmi_export::{Boolean, Integer, Real, Table};

/// Handles; names and values are those of the plant's description in the README.
#[allow(non_snake_case)]
pub struct Parameters {
    pub bore: Real,
    pub rod: Real,
    pub stroke: Real,
    pub dead: Real,
    pub psup: Real,
    pub patm: Real,
    pub T: Real,
    pub R: Real,
    pub kin: Real,
    pub kout: Real,
    pub kv: Real,
    pub Cd: Real,
    pub Avmax: Real,
    pub overlap: Real,
    pub ws: Real,
    pub zs: Real,
    pub Kp: Real,
    pub Ki: Real,
    pub tau_cmd: Real,
    pub vhys: Real,
    pub Vt: Real,
    pub At: Real,
    pub tdelay: Real,
    pub leak: Real,
    pub eta: Real,
    pub rod_fixed: Boolean,
    pub seal: Real,
    pub sealx: Real,
    pub klc: Real,
    pub sample_time: Real,
    pub substeps: Integer,
}

impl Parameters {
    /// Declares all of them. A quantity that the equations divide by has a small positive bound, others may be 0.
    pub fn declare(t: &mut Table) -> Self {
        let mut real = |name: &'static str, unit: &'static str, about: &'static str, low: f64, start: f64| {
            let d = t.parameter(name).about(about).min(low).nominal(start);
            if unit.is_empty() { d.real(start) } else { d.unit(unit).real(start) }
        };
        Self {
            bore: real("bore", "m", "bore of the cylinder", 1e-6, 0.020),
            rod: real("rod", "m", "diameter of the rod, in chamber 2", 0.0, 0.008),
            stroke: real("stroke", "m", "stroke; x runs over half of it to both sides", 1e-6, 0.300),
            dead: real("dead", "m3", "dead volume of a chamber", 1e-12, 2.0e-6),
            psup: real("psup", "Pa", "supply pressure, gauge", 1.0, 0.5e6),
            patm: real("patm", "Pa", "ambient pressure", 1.0, 101_325.0),
            T: real("T", "K", "temperature of the air, everywhere", 1.0, 293.0),
            R: real("R", "J/(kg.K)", "gas constant of the air", 1.0, 287.0),
            kin: real("kin", "", "heat-transfer exponent of inflow", 0.0, 1.4),
            kout: real("kout", "", "heat-transfer exponent of outflow", 0.0, 1.0),
            kv: real("kv", "", "heat-transfer exponent of the volume's work", 0.0, 1.2),
            Cd: real("Cd", "", "discharge coefficient of valve and tube", 0.0, 0.8),
            Avmax: real("Avmax", "m2", "full opening of a valve", 0.0, 3.0e-6),
            overlap: real("overlap", "", "overlap of the spool, as part of its full stroke", 0.0, 0.02),
            ws: real("ws", "rad/s", "natural frequency of the spool", 0.0, 2.0 * std::f64::consts::PI * 70.0),
            zs: real("zs", "", "damping ratio of the spool", 0.0, 0.7),
            Kp: real("Kp", "1/Pa", "proportional gain of the valve's pressure controller", 0.0, 8.0e-6),
            Ki: real("Ki", "1/(Pa.s)", "integral gain of the valve's pressure controller", 0.0, 1.0e-4),
            tau_cmd: real("tau_cmd", "s", "time constant of the command filter", 1e-6, 0.0015),
            vhys: real("vhys", "Pa", "half width of the play on the pressure command", 0.0, 1500.0),
            Vt: real("Vt", "m3", "volume of tube and valve port", 1e-12, 9.0e-6),
            At: real("At", "m2", "equivalent orifice of the tube, times Cd", 0.0, 1.4e-6),
            tdelay: real("tdelay", "s", "transport delay of the tube, rounded to substeps", 0.0, 0.003),
            leak: real("leak", "m2", "leak of the piston seal", 0.0, 0.010e-6),
            eta: real("eta", "", "effective-area factor of the piston", 0.0, 0.955),
            seal: real("seal", "N", "force of the seal on a fixed rod", 0.0, 1.2),
            sealx: real("sealx", "m", "pre-sliding distance of the seal", 1e-9, 8.0e-6),
            klc: real("klc", "N/m", "stiffness of the load cell that holds the fixed rod", 1.0, 4.0e5),
            sample_time: real("sample_time", "s", "sample time of command, play and seal", 1e-6, 1e-3),
            substeps: t
                .parameter("substeps")
                .about("steps of the delay line per sample")
                .range(1.0, 1000.0)
                .integer(10),
            rod_fixed: t
                .parameter("rod_fixed")
                .about("the rod is held by the load cell: F_act includes the seal's pre-sliding")
                .boolean(false),
        }
    }
}
