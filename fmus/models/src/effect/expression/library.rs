//! The formulas that the instances of one library have read: text is read once, whatever evaluates it later.

use std::sync::{Arc, PoisonError, RwLock};

use super::STATES;
use super::law::Law;

/// Formulas by the fingerprint of their texts.
#[derive(Debug, Default)]
pub struct Library(RwLock<Vec<(f64, Arc<Law>)>>);

impl Library {
    /// The formulas with this fingerprint.
    pub fn get(&self, fingerprint: f64) -> Option<Arc<Law>> {
        let known = self.0.read().unwrap_or_else(PoisonError::into_inner);
        known.iter().find(|(own, _)| *own == fingerprint).map(|(_, law)| Arc::clone(law))
    }

    /// Reads formulas that are not known yet, and gives their fingerprint.
    ///
    /// # Errors
    /// See [`Law::read`].
    pub fn load(&self, texts: &[&str; 3 + STATES]) -> Result<f64, String> {
        let fingerprint = fingerprint(texts);
        if self.get(fingerprint).is_none() {
            let law = Arc::new(Law::read(texts)?);
            self.0.write().unwrap_or_else(PoisonError::into_inner).push((fingerprint, law));
        }
        Ok(fingerprint)
    }
}

/// FNV-1a of 64 bits, of which a number keeps 52; never 0.
fn fingerprint(texts: &[&str]) -> f64 {
    let bytes = texts.iter().flat_map(|text| text.bytes().chain([0]));
    let hash =
        bytes.fold(0xcbf2_9ce4_8422_2325_u64, |h, byte| (h ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3));
    1.0 + (hash >> 12) as f64
}
