//! Bytes of an FMU state: versioned, bound to the FMU's GUID, checked.

use crate::ctypes::Status;
use crate::instance::{Instance, State};
use crate::model::Model;
use crate::state_machine::Mode;
use crate::values::{Interface, Values};

const MAGIC: &[u8; 8] = b"fmi2exst";
const VERSION: u32 = 1;

/// Object behind an `fmi2FMUstate` pointer (FMI 2.0.4 section 2.1.8).
pub(crate) struct Snapshot {
    pub state: State,
}

/// The state as bytes.
pub(crate) fn serialize(guid: &str, state: &State, bytes: &mut Vec<u8>) {
    bytes.clear();
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&VERSION.to_le_bytes());
    text(bytes, guid);
    let start = bytes.len();
    bytes.extend_from_slice(&[0; 16]); // length and checksum of what follows
    let body = bytes.len();
    write_state(bytes, state);
    let length = (bytes.len() - body) as u64;
    let sum = checksum(&bytes[body..]);
    bytes[start..start + 8].copy_from_slice(&length.to_le_bytes());
    bytes[start + 8..start + 16].copy_from_slice(&sum.to_le_bytes());
}

/// The state that `bytes` hold, for an instance of the same model and interface.
///
/// # Errors
/// Says why the bytes are not a state of this FMU.
pub(crate) fn deserialize<M: Model>(instance: &Instance<M>, bytes: &[u8]) -> Result<Snapshot, String> {
    let mut r = Reader { bytes };
    if r.take(8) != Some(MAGIC) {
        return Err("the bytes are not a serialized FMU state of this exporter".into());
    }
    let version = r.u32().unwrap_or(0);
    if version != VERSION {
        return Err(format!("the bytes have format version {version}, this library reads {VERSION}"));
    }
    let guid = r.text().ok_or("the bytes end early")?;
    if guid != instance.guid {
        return Err(format!("the bytes are a state of another FMU: GUID {guid}, not {}", instance.guid));
    }
    let (length, sum) = (r.u64().ok_or("the bytes end early")?, r.u64().ok_or("the bytes end early")?);
    if length != r.bytes.len() as u64 || sum != checksum(r.bytes) {
        return Err("the bytes are damaged: length or checksum is wrong".into());
    }
    let state = read_state(&mut r, &instance.state).ok_or("the bytes do not fit this FMU")?;
    if state.values.interface != instance.interface() {
        return Err("the bytes are a state of the other interface (Model Exchange / Co-Simulation)".into());
    }
    Ok(Snapshot { state })
}

fn write_state(b: &mut Vec<u8>, s: &State) {
    b.push(s.mode as u8);
    b.push(u8::from(s.values.interface == Interface::CoSimulation));
    for flag in [
        s.dirty,
        s.parameters_dirty,
        s.sample_taken,
        s.terminated,
        s.values.at_sample,
        s.stop_time.is_some(),
        s.tolerance.is_some(),
    ] {
        b.push(u8::from(flag));
    }
    b.push(s.last_step_status as u8);
    b.extend_from_slice(&s.sample_index.to_le_bytes());
    for x in [
        s.values.time,
        s.start_time,
        s.stop_time.unwrap_or(0.0),
        s.tolerance.unwrap_or(0.0),
        s.proposed_step,
        s.last_successful_time,
    ] {
        b.extend_from_slice(&x.to_bits().to_le_bytes());
    }
    for list in [&s.values.real, &s.values.memory, &s.pre_real, &s.pre_memory, &s.input_rates, &s.end_rates] {
        b.extend_from_slice(&(list.len() as u64).to_le_bytes());
        for x in list {
            b.extend_from_slice(&x.to_bits().to_le_bytes());
        }
    }
    b.extend_from_slice(&(s.values.integer.len() as u64).to_le_bytes());
    for i in &s.values.integer {
        b.extend_from_slice(&i.to_le_bytes());
    }
    b.extend_from_slice(&(s.values.boolean.len() as u64).to_le_bytes());
    b.extend(s.values.boolean.iter().map(|x| u8::from(*x)));
    b.extend_from_slice(&(s.values.text.len() as u64).to_le_bytes());
    for t in &s.values.text {
        text(b, t);
    }
}

fn read_state(r: &mut Reader, like: &State) -> Option<State> {
    let mode = *Mode::ALL.get(usize::from(r.u8()?))?;
    let interface = if r.bool()? { Interface::CoSimulation } else { Interface::ModelExchange };
    let flags: [bool; 7] = [r.bool()?, r.bool()?, r.bool()?, r.bool()?, r.bool()?, r.bool()?, r.bool()?];
    let [dirty, parameters_dirty, sample_taken, terminated, at_sample, has_stop, has_tolerance] = flags;
    let last_step_status = match r.u8()? {
        0 => Status::OK,
        2 => Status::Discard,
        3 => Status::Error,
        _ => return None,
    };
    let sample_index = r.u64()?;
    let [time, start_time, stop, tolerance, proposed_step, last_successful_time] =
        [r.f64()?, r.f64()?, r.f64()?, r.f64()?, r.f64()?, r.f64()?];
    let real = r.f64s(like.values.real.len())?;
    let memory = r.f64s(like.values.memory.len())?;
    let pre_real = r.f64s(like.pre_real.len())?;
    let pre_memory = r.f64s(like.pre_memory.len())?;
    let input_rates = r.f64s(like.input_rates.len())?;
    let end_rates = r.f64s(like.end_rates.len())?;
    r.count(like.values.integer.len())?;
    let integer: Vec<i32> = like.values.integer.iter().map(|_| r.i32()).collect::<Option<_>>()?;
    r.count(like.values.boolean.len())?;
    let boolean: Vec<bool> = like.values.boolean.iter().map(|_| r.bool()).collect::<Option<_>>()?;
    r.count(like.values.text.len())?;
    let text: Vec<String> = like.values.text.iter().map(|_| r.text()).collect::<Option<_>>()?;
    r.bytes.is_empty().then_some(())?;
    Some(State {
        mode,
        values: Values { time, interface, at_sample, real, memory, integer, boolean, text },
        dirty,
        parameters_dirty,
        start_time,
        stop_time: has_stop.then_some(stop),
        tolerance: has_tolerance.then_some(tolerance),
        sample_index,
        sample_taken,
        pre_real,
        pre_memory,
        input_rates,
        end_rates,
        proposed_step,
        last_successful_time,
        last_step_status,
        terminated,
    })
}

fn text(b: &mut Vec<u8>, t: &str) {
    b.extend_from_slice(&(t.len() as u64).to_le_bytes());
    b.extend_from_slice(t.as_bytes());
}

/// FNV-1a, 64 bit: finds damage, not forgery.
fn checksum(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x0100_0000_01b3))
}

struct Reader<'a> {
    bytes: &'a [u8],
}

impl<'a> Reader<'a> {
    fn take(&mut self, n: usize) -> Option<&'a [u8]> {
        let (head, tail) = self.bytes.split_at_checked(n)?;
        self.bytes = tail;
        Some(head)
    }
    fn u8(&mut self) -> Option<u8> {
        self.take(1).map(|b| b[0])
    }
    fn bool(&mut self) -> Option<bool> {
        self.u8().and_then(|b| match b {
            0 => Some(false),
            1 => Some(true),
            _ => None,
        })
    }
    fn u32(&mut self) -> Option<u32> {
        Some(u32::from_le_bytes(self.take(4)?.try_into().ok()?))
    }
    fn i32(&mut self) -> Option<i32> {
        Some(i32::from_le_bytes(self.take(4)?.try_into().ok()?))
    }
    fn u64(&mut self) -> Option<u64> {
        Some(u64::from_le_bytes(self.take(8)?.try_into().ok()?))
    }
    fn f64(&mut self) -> Option<f64> {
        Some(f64::from_bits(self.u64()?))
    }
    fn count(&mut self, expected: usize) -> Option<()> {
        (self.u64()? == expected as u64).then_some(())
    }
    fn f64s(&mut self, expected: usize) -> Option<Vec<f64>> {
        self.count(expected)?;
        (0..expected).map(|_| self.f64()).collect()
    }
    fn text(&mut self) -> Option<String> {
        let n = usize::try_from(self.u64()?).ok()?;
        String::from_utf8(self.take(n)?.to_vec()).ok()
    }
}
