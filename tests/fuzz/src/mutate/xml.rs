//! Changes of XML: elements, attributes and their values.

use super::{Dice, numbers};

/// Deepest nesting that is made.
const MAX_DEPTH: u32 = 15;

/// A tag in a text.
struct Tag {
    from: usize,
    to: usize,
    closes: bool,
    empty: bool,
}

fn tags(text: &str) -> Vec<Tag> {
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(open) = text[at..].find('<') {
        let from = at + open;
        let Some(close) = text[from..].find('>') else { break };
        let to = from + close + 1;
        let inner = &text[from + 1..to - 1];
        if !inner.starts_with(['?', '!']) {
            found.push(Tag { from, to, closes: inner.starts_with('/'), empty: inner.ends_with('/') });
        }
        at = to;
    }
    found
}

/// Begin and end of the element whose first tag is number `first`.
fn element(tags: &[Tag], first: usize) -> (usize, usize) {
    let mut depth = 0_i32;
    for tag in &tags[first..] {
        depth += match (tag.closes, tag.empty) {
            (true, _) => -1,
            (false, true) => 0,
            (false, false) => 1,
        };
        if depth <= 0 {
            return (tags[first].from, tag.to);
        }
    }
    (tags[first].from, tags.last().map_or(tags[first].to, |tag| tag.to))
}

/// Places of attributes in a tag: begin and end of the whole, and of the value.
fn attributes(text: &str, tag: &Tag) -> Vec<[usize; 4]> {
    let mut found = Vec::new();
    let mut at = tag.from;
    while let Some(equal) = text[at..tag.to].find("=\"") {
        let value = at + equal + 2;
        let Some(end) = text[value..tag.to].find('"') else { break };
        let name = text[tag.from..at + equal].rfind(char::is_whitespace).map_or(at, |space| tag.from + space);
        found.push([name, value + end + 1, value, value + end]);
        at = value + end + 1;
    }
    found
}

/// The text with one change.
pub fn mutate(text: &str, dice: &mut Dice) -> String {
    let tags = tags(text);
    let opening: Vec<usize> = (0..tags.len()).filter(|&index| !tags[index].closes).collect();
    let Some(&first) = dice.pick(&opening) else { return numbers::replace_one(text, dice) };
    let tag = &tags[first];
    let (from, to) = element(&tags, first);
    let (before, own, after) = (&text[..from], &text[from..to], &text[to..]);
    let attributes = attributes(text, tag);
    match dice.below(10) {
        0 => format!("{before}{after}"),
        1 => format!("{before}{}{after}", own.repeat(2 + dice.below(30))),
        2 => {
            // The element inside of itself, again and again.
            let mut nested = own.to_owned();
            for _ in 0..dice.below(MAX_DEPTH as usize) {
                let at = tag.to - tag.from;
                if tag.empty || nested.len() > 1 << 18 {
                    break;
                }
                nested = format!("{}{nested}{}", &own[..at], &own[at..]);
            }
            format!("{before}{nested}{after}")
        }
        3 => {
            let Some(&other) = dice.pick(&opening) else { return text.to_owned() };
            let (start, end) = element(&tags, other);
            format!("{before}{}{after}", &text[start..end])
        }
        4 => {
            let Some(&[start, end, ..]) = dice.pick(&attributes) else { return text.to_owned() };
            match dice.below(2) {
                0 => format!("{}{}", &text[..start], &text[end..]),
                _ => format!("{}{}{}", &text[..end], &text[start..end], &text[end..]),
            }
        }
        5 => format!("{before}{}{own}{after}", numbers::word(dice)),
        _ => {
            let Some(&[_, _, start, end]) = dice.pick(&attributes) else {
                return numbers::replace_one(text, dice);
            };
            let value = match dice.below(4) {
                0 => numbers::word(dice).replace(['<', '"'], ""),
                1 => {
                    // The value of another attribute of the document.
                    let Some(&other) = dice.pick(&opening) else { return text.to_owned() };
                    let others = self::attributes(text, &tags[other]);
                    dice.pick(&others).map_or_else(String::new, |&[_, _, from, to]| text[from..to].to_owned())
                }
                _ => numbers::value(dice),
            };
            format!("{}{value}{}", &text[..start], &text[end..])
        }
    }
}
