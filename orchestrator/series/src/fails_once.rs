//! A writer that fails once, for formats that go on writing when they are dropped.

use std::io::{Result, Seek, SeekFrom, Write};

/// A writer whose first failure is its last: what is written after it goes nowhere and is no error. A zip archive on a
/// full disk ends with one error then, and not with a second line of its own.
#[derive(Debug)]
pub struct FailsOnce<W> {
    inner: W,
    failed: bool,
    /// Place of the next byte.
    place: u64,
    /// Bytes so far.
    end: u64,
}

impl<W> FailsOnce<W> {
    /// Writes to `inner` from its first byte.
    pub fn new(inner: W) -> FailsOnce<W> {
        FailsOnce { inner, failed: false, place: 0, end: 0 }
    }

    fn once<T>(&mut self, outcome: Result<T>) -> Result<T> {
        self.failed |= outcome.is_err();
        outcome
    }
}

impl<W: Write> Write for FailsOnce<W> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        let outcome = if self.failed { Ok(bytes.len()) } else { self.inner.write(bytes) };
        let count = self.once(outcome)?;
        self.place += count as u64;
        self.end = self.end.max(self.place);
        Ok(count)
    }

    fn flush(&mut self) -> Result<()> {
        let outcome = if self.failed { Ok(()) } else { self.inner.flush() };
        self.once(outcome)
    }
}

impl<W: Seek> Seek for FailsOnce<W> {
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        let from = |begin: u64, offset: i64| Ok(begin.saturating_add_signed(offset));
        let outcome = match to {
            _ if !self.failed => self.inner.seek(to),
            SeekFrom::Start(place) => Ok(place),
            SeekFrom::Current(offset) => from(self.place, offset),
            SeekFrom::End(offset) => from(self.end, offset),
        };
        self.place = self.once(outcome)?;
        Ok(self.place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Error;

    /// Takes eight bytes.
    struct Full(usize);

    impl Write for Full {
        fn write(&mut self, bytes: &[u8]) -> Result<usize> {
            self.0 += bytes.len();
            if self.0 > 8 { Err(Error::other("full")) } else { Ok(bytes.len()) }
        }

        fn flush(&mut self) -> Result<()> {
            Err(Error::other("full"))
        }
    }

    impl Seek for Full {
        fn seek(&mut self, _: SeekFrom) -> Result<u64> {
            Err(Error::other("full"))
        }
    }

    #[test]
    fn the_first_failure_is_the_last() {
        let mut out = FailsOnce::new(Full(0));
        assert_eq!(out.write(b"12345678").unwrap(), 8);
        assert!(out.write(b"9").is_err());
        assert_eq!(out.write(b"9").unwrap(), 1);
        out.flush().unwrap();
        assert_eq!(out.stream_position().unwrap(), 9);
        assert_eq!(out.seek(SeekFrom::Start(2)).unwrap(), 2);
        assert_eq!(out.seek(SeekFrom::End(-1)).unwrap(), 8);
    }
}
