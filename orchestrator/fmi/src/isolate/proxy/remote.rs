//! An instance in a worker: calls are gathered here and sent in turns.

use std::cell::Cell;
use std::ffi::{CStr, CString, c_void};
use std::sync::Arc;

use crate::isolate::calls::*;
use crate::isolate::channel::{Answer, Channel};
use crate::log::LogBuffer;
use crate::open::{Fmu, InterfaceKind};

/// Deferred setters take at most \[bytes\].
const MAX_DEFERRED: usize = 1 << 16;

thread_local! {
    static REFUSED_SETTER: Cell<Option<(&'static str, u32)>> = const { Cell::new(None) };
}

/// The setter that failed when it was sent with the call that failed last in this thread, with its status.
pub(crate) fn refused_setter() -> Option<(&'static str, u32)> {
    REFUSED_SETTER.take()
}

/// Frees what this process holds of an instance that must not be called any more.
pub(crate) fn forget(component: *mut c_void) {
    // SAFETY: made by `instantiate` below, and not used after this.
    drop(unsafe { Box::from_raw(component.cast::<Remote>()) });
}

/// An instance in a worker.
pub(super) struct Remote {
    pub(super) channel: Arc<Channel>,
    pub(super) instance: u64,
    /// Where messages go.
    pub(super) log: *const LogBuffer,
    /// Deferred setters, and which they are.
    pub(super) deferred: Calls,
    pub(super) functions: Vec<u32>,
    pub(super) calls: Calls,
    /// Initialized: setters may be deferred.
    pub(super) running: bool,
    pub(super) after_step: bool,
    /// Reading that followed the last step, and how many steps it followed.
    pub(super) reading: Vec<u32>,
    pub(super) habit: u32,
    /// Values of that reading after the last step, if nothing came between.
    pub(super) values: Vec<f64>,
    pub(super) ready: bool,
    pub(super) texts: Vec<CString>,
}

impl Remote {
    /// Begins a call that is sent at once.
    pub(super) fn begin(&mut self, function: u32) -> &mut Calls {
        self.ready = false;
        self.after_step = function == DO_STEP;
        self.calls.bytes.clear();
        self.calls.bytes.extend_from_slice(&self.deferred.bytes);
        self.deferred.bytes.clear();
        self.calls.begin(function, self.instance);
        &mut self.calls
    }

    /// Begins a setter, which is deferred if it may be.
    pub(super) fn begin_setter(&mut self, function: u32) -> &mut Calls {
        self.ready = false;
        self.after_step = false;
        self.deferred.begin(function, self.instance);
        self.functions.push(function);
        &mut self.deferred
    }

    /// Ends a setter: its status, as far as it is known.
    pub(super) fn end_setter(&mut self) -> u32 {
        if self.running && self.deferred.bytes.len() < MAX_DEFERRED {
            return 0;
        }
        self.calls.bytes.clear();
        self.calls.bytes.append(&mut self.deferred.bytes);
        // The last setter is the call itself.
        self.functions.pop();
        self.send().0
    }

    /// Sends what was begun; its status and what it gave.
    pub(super) fn send(&mut self) -> (u32, Vec<u8>) {
        self.send_with(0)
    }

    /// Same, where the last `more` calls come after the one whose status counts.
    pub(super) fn send_with(&mut self, more: u64) -> (u32, Vec<u8>) {
        let deferred = self.functions.len() as u64;
        let answer = self.channel.call(&self.calls);
        let Some(Answer { status, index, payload, log }) = answer else {
            self.functions.clear();
            return (LOST, Vec::new());
        };
        if !self.log.is_null() {
            // SAFETY: the environment that `instantiate` was given: a log buffer that outlives the component.
            let buffer = unsafe { &*self.log };
            log.into_iter().for_each(|message| buffer.push(message));
        }
        let status = if index < deferred {
            let function = self.functions[usize::try_from(index).unwrap_or(0)];
            REFUSED_SETTER.set(Some((name(function), status)));
            // The call itself was not made. Whatever the setter said, this instance cannot go on as if it had.
            status.max(3)
        } else if index > deferred && status > 1 && more > 0 {
            // A later reading failed: it is asked for again, and answers for itself.
            self.habit = 0;
            0
        } else {
            status
        };
        self.functions.clear();
        (status, payload)
    }

    pub(super) fn get(&mut self, function: u32, references: &[u32], values: &mut [u8]) -> u32 {
        self.begin(function).block(bytes_of(references));
        self.receive(values)
    }

    /// Sends what was begun, whose answer is a block of values.
    pub(super) fn receive(&mut self, values: &mut [u8]) -> u32 {
        let (status, payload) = self.send();
        match (Parts { bytes: &payload }).block() {
            Some(block) if block.len() == values.len() => values.copy_from_slice(block),
            _ if status <= 1 => return REFUSED,
            _ => {}
        }
        status
    }

    pub(super) fn simple(&mut self, function: u32) -> u32 {
        self.begin(function);
        self.send().0
    }
}

/// The instance behind a component.
///
/// # Safety
/// `component` was made by [`instantiate()`] and not freed, and nobody else uses it now.
pub(super) unsafe fn remote<'a>(component: *mut c_void) -> &'a mut Remote {
    // SAFETY: as the caller promises.
    unsafe { &mut *component.cast::<Remote>() }
}

/// Makes an instance in a worker; NULL if the FMU refuses or the worker is lost. `log` has to outlive the component.
pub(crate) fn instantiate(
    channel: &Arc<Channel>,
    fmu: &Fmu,
    (name, guid): (&CStr, &CStr),
    kind: InterfaceKind,
    logging: bool,
    log: *const LogBuffer,
) -> *mut c_void {
    let mut remote = Box::new(Remote {
        channel: Arc::clone(channel),
        instance: 0,
        log,
        deferred: Calls::default(),
        functions: Vec::new(),
        calls: Calls::default(),
        running: false,
        after_step: false,
        reading: Vec::new(),
        habit: 0,
        values: Vec::new(),
        ready: false,
        texts: Vec::new(),
    });
    let calls = remote.begin(INSTANTIATE);
    calls.block(name.to_bytes());
    calls.block(guid.to_bytes());
    calls.number(u64::from(kind == InterfaceKind::CoSimulation));
    calls.number(u64::from(logging));
    calls.number(fmu.sizes.len() as u64);
    for (name, size) in &fmu.sizes {
        calls.block(name.as_bytes());
        calls.number(size.cast_unsigned());
    }
    let (status, payload) = remote.send();
    match (Parts { bytes: &payload }).number() {
        Some(instance) if status == 0 => {
            remote.instance = instance;
            Box::into_raw(remote).cast()
        }
        _ => std::ptr::null_mut(),
    }
}
