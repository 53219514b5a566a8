//! From text to a tree: recursive descent.

use super::curve::Curve;
use super::{Error, Function, Kind, Node};

/// Brackets within brackets.
const MAX_NESTED_BRACKETS: usize = 64;
/// Bytes of a formula: what is evaluated by recursion must end.
const MAX_BYTES: usize = 4000;

const FUNCTIONS: [&str; 14] = [
    "sin", "cos", "tan", "tanh", "exp", "ln", "sqrt", "abs", "sign", "floor", "min", "max", "clamp", "curve",
];

/// Reads a formula.
pub(crate) fn parse(text: &str, names: &[&str]) -> Result<Node, Error> {
    if text.len() > MAX_BYTES {
        let problem = format!("the formula has {} characters; {MAX_BYTES} are allowed", text.len());
        return Err(Error { at: MAX_BYTES, problem });
    }
    let mut reader = Reader { text, at: 0, names, depth: 0 };
    let root = reader.sum()?;
    match reader.peek() {
        None => Ok(root),
        Some(found) => Err(reader.error(format!("`{found}` is out of place; an operator or the end is due"))),
    }
}

struct Reader<'a> {
    text: &'a str,
    at: usize,
    names: &'a [&'a str],
    depth: usize,
}

fn node(at: usize, kind: Kind) -> Node {
    Node { at, kind }
}

impl Reader<'_> {
    fn error(&self, problem: String) -> Error {
        Error { at: self.at, problem }
    }

    /// Next character behind spaces.
    fn peek(&mut self) -> Option<char> {
        let rest = &self.text[self.at..];
        self.at += rest.len() - rest.trim_start().len();
        self.text[self.at..].chars().next()
    }

    fn take(&mut self, wanted: char) -> bool {
        let found = self.peek() == Some(wanted);
        if found {
            self.at += wanted.len_utf8();
        }
        found
    }

    fn expect(&mut self, wanted: char) -> Result<(), Error> {
        if self.take(wanted) {
            return Ok(());
        }
        let found = self.peek().map_or("the end".into(), |c| format!("`{c}`"));
        Err(self.error(format!("`{wanted}` is due, and there is {found}")))
    }

    fn sum(&mut self) -> Result<Node, Error> {
        self.depth += 1;
        if self.depth > MAX_NESTED_BRACKETS {
            return Err(self.error(format!("more than {MAX_NESTED_BRACKETS} brackets within each other")));
        }
        let mut left = self.product()?;
        loop {
            let sign = self.peek();
            let at = self.at;
            if self.take('+') {
                left = node(at, Kind::Sum(Box::new(left), Box::new(self.product()?)));
            } else if sign == Some('-') {
                self.take('-');
                left = node(at, Kind::Difference(Box::new(left), Box::new(self.product()?)));
            } else {
                self.depth -= 1;
                return Ok(left);
            }
        }
    }

    fn product(&mut self) -> Result<Node, Error> {
        let mut left = self.signed()?;
        loop {
            let sign = self.peek();
            let at = self.at;
            if self.take('*') {
                left = node(at, Kind::Product(Box::new(left), Box::new(self.signed()?)));
            } else if sign == Some('/') {
                self.take('/');
                left = node(at, Kind::Quotient(Box::new(left), Box::new(self.signed()?)));
            } else {
                return Ok(left);
            }
        }
    }

    fn signed(&mut self) -> Result<Node, Error> {
        self.peek();
        let at = self.at;
        let mut negative = false;
        while matches!(self.peek(), Some('-' | '+')) {
            negative ^= self.peek() == Some('-');
            self.at += 1;
        }
        let own = self.power()?;
        Ok(if negative { node(at, Kind::Negative(Box::new(own))) } else { own })
    }

    fn power(&mut self) -> Result<Node, Error> {
        let base = self.atom()?;
        self.peek();
        let at = self.at;
        if !self.take('^') {
            return Ok(base);
        }
        self.depth += 1;
        if self.depth > MAX_NESTED_BRACKETS {
            return Err(self.error(format!("more than {MAX_NESTED_BRACKETS} powers within each other")));
        }
        self.peek();
        let place = self.at;
        let exponent = self.signed()?;
        self.depth -= 1;
        let Some(number) = constant(&exponent) else {
            let problem = "an exponent must be a number; write exp(b*ln(a)) for a^b".to_owned();
            return Err(Error { at: place, problem });
        };
        Ok(node(at, Kind::Power(Box::new(base), number)))
    }

    fn atom(&mut self) -> Result<Node, Error> {
        let Some(first) = self.peek() else {
            return Err(self.error("the formula ends where a number, a name or `(` is due".into()));
        };
        let at = self.at;
        if self.take('(') {
            let inner = self.sum()?;
            self.expect(')')?;
            return Ok(inner);
        }
        if first.is_ascii_digit() || first == '.' {
            return self.number();
        }
        if first.is_alphabetic() || first == '_' {
            let rest = &self.text[at..];
            let end = rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len());
            let name = &rest[..end];
            self.at += end;
            if let Some(index) = self.names.iter().position(|own| *own == name) {
                return Ok(node(at, Kind::Variable(index)));
            }
            if FUNCTIONS.contains(&name) {
                return self.call(at, name);
            }
            if name == "pi" {
                return Ok(node(at, Kind::Number(std::f64::consts::PI)));
            }
            let problem = format!(
                "there is no `{name}`; names are {}; functions are {}",
                self.names.join(", "),
                FUNCTIONS.join(", ")
            );
            return Err(Error { at, problem });
        }
        Err(self.error(format!("`{first}` is out of place; a number, a name or `(` is due")))
    }

    fn number(&mut self) -> Result<Node, Error> {
        let (at, bytes) = (self.at, self.text.as_bytes());
        let mut end = at;
        let digit = |k: usize| bytes.get(k).is_some_and(|b| b.is_ascii_digit() || *b == b'.');
        while digit(end) {
            end += 1;
        }
        if matches!(bytes.get(end), Some(b'e' | b'E')) {
            let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
            if digit(end + 1 + sign) {
                end += 1 + sign;
                while digit(end) {
                    end += 1;
                }
            }
        }
        let text = &self.text[at..end];
        let Some(value) = text.parse::<f64>().ok().filter(|value| value.is_finite()) else {
            return Err(self.error(format!("`{text}` is no number")));
        };
        self.at = end;
        Ok(node(at, Kind::Number(value)))
    }

    fn call(&mut self, at: usize, name: &str) -> Result<Node, Error> {
        self.expect('(')?;
        let mut arguments = vec![self.sum()?];
        while self.take(',') {
            arguments.push(self.sum()?);
        }
        self.expect(')')?;
        let count = arguments.len();
        let mut next = arguments.into_iter().map(Box::new);
        let wrong = |wanted: &str| {
            Err(Error { at, problem: format!("{name} takes {wanted}; there are {count} arguments") })
        };
        let mut take = || next.next().unwrap_or_else(|| Box::new(node(at, Kind::Number(0.0))));
        let kind = match (name, count) {
            ("min", 2) => Kind::Minimum(take(), take()),
            ("max", 2) => Kind::Maximum(take(), take()),
            ("min" | "max", _) => return wrong("two numbers"),
            ("clamp", 3) => {
                let (value, low, high) = (take(), take(), take());
                Kind::Minimum(Box::new(node(at, Kind::Maximum(value, low))), high)
            }
            ("clamp", _) => return wrong("a value, a least and a largest one"),
            ("curve", _) if count >= 5 && count % 2 == 1 => {
                let value = take();
                let (mut places, mut heights) = (Vec::new(), Vec::new());
                for _ in 0..count / 2 {
                    let (place, height) = (take(), take());
                    let Some(number) = constant(&place).filter(|x| places.last().is_none_or(|last| x > last))
                    else {
                        let problem = "the places of a curve must be rising numbers".to_owned();
                        return Err(Error { at: place.at, problem });
                    };
                    places.push(number);
                    heights.push(*height);
                }
                Kind::Curve(value, Curve { places, heights })
            }
            ("curve", _) => return wrong("a variable and at least two points, `curve(x, x1, y1, x2, y2)`"),
            (_, 1) => match name {
                "sin" => Kind::Call(Function::Sin, take()),
                "cos" => Kind::Call(Function::Cos, take()),
                "tanh" => Kind::Call(Function::Tanh, take()),
                "exp" => Kind::Call(Function::Exp, take()),
                "ln" => Kind::Call(Function::Ln, take()),
                "sqrt" => Kind::Call(Function::Sqrt, take()),
                "abs" => Kind::Call(Function::Abs, take()),
                "sign" => Kind::Call(Function::Sign, take()),
                "floor" => Kind::Call(Function::Floor, take()),
                _ => {
                    let angle = take();
                    let sine = node(at, Kind::Call(Function::Sin, angle.clone()));
                    Kind::Quotient(Box::new(sine), Box::new(node(at, Kind::Call(Function::Cos, angle))))
                }
            },
            _ => return wrong("one number"),
        };
        Ok(node(at, kind))
    }
}

/// Value of a part without names.
fn constant(own: &Node) -> Option<f64> {
    fn plain(own: &Node) -> bool {
        !matches!(own.kind, Kind::Variable(_)) && own.children().iter().all(|node| plain(node))
    }
    let point = super::evaluate::Point { variables: &[], call: &Function::of };
    plain(own).then(|| own.evaluate(&point)).filter(|value: &f64| value.is_finite())
}

#[cfg(test)]
mod tests {
    use super::super::Expression;

    #[test]
    fn what_cannot_be_read_is_told_with_its_column() {
        for (text, column, words) in [
            ("k*y", 3, "there is no `y`; names are x, k"),
            ("k*", 3, "ends"),
            ("(x", 3, "`)` is due"),
            ("x)", 2, "out of place"),
            ("x $ 2", 3, "`$`"),
            ("sin(x, k)", 1, "takes one number"),
            ("min(x)", 1, "takes two"),
            ("curve(x, 1, 2, 0, 3)", 16, "rising"),
            ("curve(x, 1, 2, 3)", 1, "at least two points"),
            ("x^k", 3, "exponent"),
            ("1.2.3", 1, "no number"),
            ("x y", 3, "out of place"),
            ("", 1, "ends"),
            ("sin x", 5, "`(` is due"),
            ("1e999", 1, "no number"),
        ] {
            let error = Expression::parse(text, &["x", "k"]).expect_err(text);
            assert_eq!(error.at + 1, column, "{text}: {error}");
            assert!(error.to_string().contains(words), "{text}: {error}");
        }
    }

    #[test]
    fn deep_nesting_is_refused_and_not_followed() {
        for text in
            ["(".repeat(3000), "x^".repeat(1500), format!("{}x", "-(".repeat(1500)), "x+".repeat(3000)]
        {
            assert!(Expression::parse(&text, &["x"]).is_err());
        }
        let long = Expression::parse(&format!("{}x", "x+".repeat(1900)), &["x"]).expect("a long sum");
        assert_eq!(long.value(&[1.0]), 1901.0);
        assert!(Expression::parse(&format!("{}x", "-".repeat(3000)), &["x"]).is_ok());
    }

    #[test]
    fn names_may_hide_functions_and_are_found_in_the_formula() {
        let own = Expression::parse("exp*2 + café", &["exp", "café", "t"]).expect("names of one's own");
        assert_eq!(own.value(&[3.0, 1.0, 0.0]), 7.0);
        assert!(own.uses(0) && own.uses(1) && !own.uses(2));
        assert_eq!(own.size(), 5);
    }
}
