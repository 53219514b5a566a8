//! Pieces of records: some that stand for all, and some that are held out.

use crate::record::Record;

/// A piece of a signal: its index, first sample, number of samples.
pub type Piece = (usize, usize, usize);

/// Pieces of signals of the given lengths, about `samples` samples together: whole signals if there are no more, else
/// pieces spread evenly over every signal.
pub fn spread(lengths: &[usize], samples: usize) -> Vec<Piece> {
    const PIECE: usize = 4000;
    let total: usize = lengths.iter().sum();
    let mut parts = Vec::new();
    for (index, &length) in lengths.iter().enumerate() {
        if total <= samples {
            parts.push((index, 0, length));
            continue;
        }
        let share = length as f64 / total as f64 * samples as f64;
        let pieces = (share / PIECE as f64).round().max(1.0) as usize;
        let wanted = (share / pieces as f64).ceil() as usize;
        for piece in 0..pieces {
            let from = length * piece / pieces;
            parts.push((index, from, wanted.min(length - from)));
        }
    }
    parts
}

/// Pieces to estimate from and held-out pieces to judge: every second record if that leaves a fair share on both
/// sides (a record is often one kind of signal throughout, a chirp even one frequency after the other), else the last
/// third of every record.
pub fn held_out(lengths: &[usize]) -> (Vec<Piece>, Vec<Piece>) {
    let whole = |first: usize| -> Vec<Piece> {
        (first..lengths.len()).step_by(2).map(|index| (index, 0, lengths[index])).collect()
    };
    let samples = |pieces: &[Piece]| pieces.iter().map(|piece| piece.2).sum::<usize>();
    let (used, kept) = (whole(0), whole(1));
    if 3 * samples(&kept) >= samples(&used) && 3 * samples(&used) >= samples(&kept) {
        return (used, kept);
    }
    let cut = |length: usize| length - length / 3;
    let used = lengths.iter().enumerate().map(|(index, &n)| (index, 0, cut(n)));
    let kept = lengths.iter().enumerate().map(|(index, &n)| (index, cut(n), n - cut(n)));
    (used.collect(), kept.filter(|piece| piece.2 > 0).collect())
}

/// The pieces of records.
pub fn cut(records: &[Record], pieces: &[Piece]) -> Vec<Record> {
    let part = |&(index, from, n): &Piece| {
        let record = &records[index];
        let cut =
            |channels: &[Vec<f64>]| channels.iter().map(|values| values[from..from + n].to_vec()).collect();
        Record {
            name: record.name.clone(),
            sample_time: record.sample_time,
            start: record.time(from),
            inputs: cut(&record.inputs),
            outputs: cut(&record.outputs),
        }
    };
    pieces.iter().map(part).collect()
}

/// Lengths of records.
pub fn lengths(records: &[Record]) -> Vec<usize> {
    records.iter().map(Record::len).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_second_record_is_held_out_or_the_last_third_of_each() {
        assert_eq!(held_out(&[9, 6, 9]), (vec![(0, 0, 9), (2, 0, 9)], vec![(1, 0, 6)]));
        assert_eq!(held_out(&[9]), (vec![(0, 0, 6)], vec![(0, 6, 3)]));
        assert_eq!(held_out(&[90, 9]), (vec![(0, 0, 60), (1, 0, 6)], vec![(0, 60, 30), (1, 6, 3)]));
    }

    #[test]
    fn pieces_are_spread_over_long_signals_and_short_ones_stay_whole() {
        assert_eq!(spread(&[100, 50], 1000), [(0, 0, 100), (1, 0, 50)]);
        let pieces = spread(&[100_000, 50_000], 12_000);
        assert_eq!(pieces, [(0, 0, 4000), (0, 50_000, 4000), (1, 0, 4000)]);
    }
}
