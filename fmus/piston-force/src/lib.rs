//! FMI 2.0 library of the model `piston-force`; the equations are in `airloop-models`.

fmi_export::export_fmu!(airloop_models::PistonForce);
