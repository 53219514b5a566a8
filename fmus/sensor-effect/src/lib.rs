//! FMI 2.0 library of the model `sensor-effect`; the equations are in `airloop-models`.

fmi_export::export_fmu!(airloop_models::SensorEffect);
