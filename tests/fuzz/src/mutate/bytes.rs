//! Changes of bytes, whatever they mean.

use super::Dice;

/// The largest input that is made.
const MAX_BYTES: usize = 1 << 20;

/// The bytes with one change.
pub fn mutate(bytes: &[u8], dice: &mut Dice) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let at = dice.below(bytes.len() + 1);
    let length = (1 + dice.below(64)).min(bytes.len() - at);
    match dice.below(8) {
        0 if at < bytes.len() => bytes[at] ^= 1 << dice.below(8),
        1 if at < bytes.len() => bytes[at] = dice.below(256) as u8,
        2 => bytes.truncate(at),
        3 => drop(bytes.drain(at..at + length)),
        4 => {
            let block = bytes[at..at + length].to_vec();
            let times = 1 + dice.below(20);
            let block = block.repeat(times);
            bytes.splice(at..at, block);
        }
        5 => {
            let odd: [&[u8]; 7] =
                [b"\0", b"\xff\xfe", b"\xef\xbb\xbf", b"\r\n", b"\xc3\x28", b"\xff\xff\xff\xff", b"<!--"];
            let block = dice.pick(&odd).copied().unwrap_or(b"\0");
            bytes.splice(at..at, block.iter().copied());
        }
        6 => {
            let other = dice.below(bytes.len() + 1);
            let length = length.min(bytes.len() - other);
            let to = at.min(bytes.len() - length);
            bytes.copy_within(other..other + length, to);
        }
        _ => bytes[at..at + length].fill(if dice.one_in(2) { 0xff } else { 0 }),
    }
    bytes.truncate(MAX_BYTES);
    bytes
}
