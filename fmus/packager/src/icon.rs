//! `model.png`: a small drawing for each model.

/// Width and height \[pixels\].
const SIZE: usize = 128;
/// Samples per pixel and direction, for smooth edges.
const SAMPLES: usize = 4;

type Color = [u8; 3];
const INK: Color = [44, 62, 80];
const BLUE: Color = [41, 128, 185];
const ORANGE: Color = [230, 126, 34];
const GREEN: Color = [39, 174, 96];
const PALE: Color = [214, 228, 240];
const GRAY: Color = [149, 165, 166];

/// A filled shape; coordinates 0 to 100 from the top left.
enum Shape {
    Disc {
        center: (f64, f64),
        radius: f64,
    },
    /// Line with round ends.
    Line {
        from: (f64, f64),
        to: (f64, f64),
        width: f64,
    },
    Rectangle {
        from: (f64, f64),
        to: (f64, f64),
    },
}

impl Shape {
    fn contains(&self, (x, y): (f64, f64)) -> bool {
        match *self {
            Self::Disc { center, radius } => (x - center.0).hypot(y - center.1) <= radius,
            Self::Line { from, to, width } => {
                let (dx, dy) = (to.0 - from.0, to.1 - from.1);
                let along = ((x - from.0) * dx + (y - from.1) * dy) / (dx * dx + dy * dy).max(1e-12);
                let t = along.clamp(0.0, 1.0);
                (x - from.0 - t * dx).hypot(y - from.1 - t * dy) <= width / 2.0
            }
            Self::Rectangle { from, to } => (from.0..=to.0).contains(&x) && (from.1..=to.1).contains(&y),
        }
    }
}

fn line(from: (f64, f64), to: (f64, f64), width: f64, color: Color) -> (Shape, Color) {
    (Shape::Line { from, to, width }, color)
}

fn disc(center: (f64, f64), radius: f64, color: Color) -> (Shape, Color) {
    (Shape::Disc { center, radius }, color)
}

fn rectangle(from: (f64, f64), to: (f64, f64), color: Color) -> (Shape, Color) {
    (Shape::Rectangle { from, to }, color)
}

/// A curve through the points `f(0)` .. `f(1)`.
fn curve(f: impl Fn(f64) -> (f64, f64), width: f64, color: Color) -> Vec<(Shape, Color)> {
    const PIECES: usize = 32;
    let at = |i: usize| f(i as f64 / PIECES as f64);
    (0..PIECES).map(|i| line(at(i), at(i + 1), width, color)).collect()
}

/// Shapes from back to front.
fn drawing(model_name: &str) -> Vec<(Shape, Color)> {
    match model_name {
        "arx-actuator" => vec![
            rectangle((8.0, 30.0), (68.0, 70.0), INK),
            rectangle((12.0, 34.0), (64.0, 66.0), PALE),
            rectangle((12.0, 34.0), (34.0, 66.0), BLUE),
            rectangle((34.0, 34.0), (42.0, 66.0), INK),
            rectangle((42.0, 46.0), (92.0, 54.0), GRAY),
            line((92.0, 38.0), (92.0, 62.0), 5.0, ORANGE),
            line((22.0, 30.0), (22.0, 16.0), 5.0, INK),
            line((54.0, 30.0), (54.0, 16.0), 5.0, INK),
        ],
        "friction" => {
            let mut shapes = vec![
                line((10.0, 50.0), (90.0, 50.0), 2.5, GRAY),
                line((50.0, 10.0), (50.0, 90.0), 2.5, GRAY),
            ];
            let force = |s: f64| {
                let v = 2.0 * s - 1.0;
                (50.0 + 38.0 * v, 50.0 - 22.0 * (8.0 * v).tanh() - 14.0 * v)
            };
            shapes.extend(curve(force, 5.0, ORANGE));
            shapes
        }
        "cart-pole" => vec![
            line((6.0, 84.0), (94.0, 84.0), 3.0, GRAY),
            rectangle((24.0, 54.0), (68.0, 74.0), BLUE),
            disc((34.0, 76.0), 7.0, INK),
            disc((58.0, 76.0), 7.0, INK),
            line((46.0, 58.0), (74.0, 18.0), 5.0, INK),
            disc((74.0, 18.0), 9.0, ORANGE),
            disc((46.0, 58.0), 4.0, PALE),
        ],
        "linear-state-space" => vec![
            rectangle((10.0, 14.0), (16.0, 86.0), INK),
            rectangle((84.0, 14.0), (90.0, 86.0), INK),
            line((50.0, 14.0), (50.0, 86.0), 2.0, GRAY),
            line((16.0, 50.0), (84.0, 50.0), 2.0, GRAY),
            disc((33.0, 32.0), 10.0, BLUE),
            disc((67.0, 32.0), 10.0, ORANGE),
            disc((33.0, 68.0), 10.0, GREEN),
            disc((67.0, 68.0), 10.0, PALE),
        ],
        "force-effect" => vec![
            line((10.0, 50.0), (90.0, 50.0), 5.0, GRAY),
            line((74.0, 38.0), (90.0, 50.0), 5.0, GRAY),
            line((74.0, 62.0), (90.0, 50.0), 5.0, GRAY),
            rectangle((34.0, 30.0), (62.0, 70.0), ORANGE),
        ],
        "torque-effect" => {
            let turn = |s: f64| {
                let angle = 5.0 * s - 1.0;
                (50.0 + 32.0 * angle.cos(), 50.0 + 32.0 * angle.sin())
            };
            let mut shapes = curve(turn, 5.0, GRAY);
            shapes.push(disc((50.0, 50.0), 13.0, ORANGE));
            shapes
        }
        "signal-effect" => vec![
            line((10.0, 50.0), (90.0, 50.0), 2.5, GRAY),
            line((10.0, 82.0), (40.0, 50.0), 5.0, ORANGE),
            line((40.0, 50.0), (60.0, 50.0), 5.0, ORANGE),
            line((60.0, 50.0), (90.0, 18.0), 5.0, ORANGE),
        ],
        "sensor-effect" => vec![
            disc((50.0, 50.0), 34.0, INK),
            disc((50.0, 50.0), 28.0, PALE),
            line((50.0, 56.0), (68.0, 32.0), 5.0, ORANGE),
            disc((50.0, 56.0), 5.0, INK),
        ],
        "pneumatic-cylinder" => vec![
            rectangle((8.0, 46.0), (68.0, 86.0), INK),
            rectangle((12.0, 50.0), (64.0, 82.0), PALE),
            rectangle((12.0, 50.0), (34.0, 82.0), BLUE),
            rectangle((34.0, 50.0), (42.0, 82.0), INK),
            rectangle((42.0, 62.0), (92.0, 70.0), GRAY),
            line((22.0, 46.0), (22.0, 30.0), 5.0, INK),
            line((54.0, 46.0), (54.0, 30.0), 5.0, INK),
            rectangle((10.0, 10.0), (34.0, 30.0), ORANGE),
            rectangle((42.0, 10.0), (66.0, 30.0), ORANGE),
        ],
        "compass-gait" => vec![
            line((6.0, 90.0), (94.0, 90.0), 3.0, GRAY),
            line((50.0, 42.0), (50.0, 14.0), 9.0, BLUE),
            line((50.0, 42.0), (34.0, 66.0), 8.0, INK),
            line((34.0, 66.0), (20.0, 87.0), 4.0, ORANGE),
            line((50.0, 42.0), (66.0, 66.0), 8.0, INK),
            line((66.0, 66.0), (80.0, 87.0), 4.0, ORANGE),
            disc((50.0, 42.0), 7.0, PALE),
        ],
        "rigid-mass" => vec![
            line((6.0, 80.0), (94.0, 80.0), 3.0, GRAY),
            rectangle((38.0, 40.0), (88.0, 78.0), BLUE),
            line((6.0, 59.0), (32.0, 59.0), 5.0, ORANGE),
            line((24.0, 51.0), (32.0, 59.0), 5.0, ORANGE),
            line((24.0, 67.0), (32.0, 59.0), 5.0, ORANGE),
        ],
        "pendulum" => vec![
            line((20.0, 14.0), (80.0, 14.0), 4.0, GRAY),
            line((50.0, 14.0), (72.0, 76.0), 5.0, INK),
            disc((72.0, 76.0), 10.0, ORANGE),
            disc((50.0, 14.0), 5.0, BLUE),
        ],
        "piston-force" => vec![
            rectangle((8.0, 26.0), (64.0, 74.0), INK),
            rectangle((12.0, 30.0), (60.0, 70.0), PALE),
            rectangle((12.0, 30.0), (30.0, 70.0), BLUE),
            rectangle((30.0, 30.0), (38.0, 70.0), INK),
            line((38.0, 50.0), (92.0, 50.0), 6.0, ORANGE),
            line((82.0, 40.0), (92.0, 50.0), 6.0, ORANGE),
            line((82.0, 60.0), (92.0, 50.0), 6.0, ORANGE),
        ],
        "tvlqr-controller" => {
            let wave = |s: f64| (8.0 + 84.0 * s, 50.0 - 30.0 * (6.0 * s).sin() * (1.0 - s));
            let beside = |s: f64| {
                let (x, y) = wave(s);
                (x, y - 24.0 * (1.0 - s) * (1.0 - s))
            };
            let mut shapes = curve(wave, 4.0, GRAY);
            shapes.extend(curve(beside, 5.0, BLUE));
            shapes.push(disc((92.0, 50.0), 7.0, ORANGE));
            shapes
        }
        "test-copy" => vec![
            disc((22.0, 50.0), 13.0, BLUE),
            disc((78.0, 50.0), 13.0, BLUE),
            line((40.0, 50.0), (58.0, 50.0), 4.0, INK),
            line((50.0, 42.0), (58.0, 50.0), 4.0, INK),
            line((50.0, 58.0), (58.0, 50.0), 4.0, INK),
        ],
        "test-bouncing-ball" => {
            let mut shapes = vec![line((6.0, 88.0), (94.0, 88.0), 3.0, GRAY)];
            for (left, width, height) in [(8.0, 36.0, 64.0), (44.0, 26.0, 38.0), (70.0, 18.0, 20.0)] {
                let arc = move |s: f64| (left + width * s, 84.0 - 4.0 * height * s * (1.0 - s));
                shapes.extend(curve(arc, 2.5, PALE));
            }
            shapes.push(disc((26.0, 22.0), 11.0, ORANGE));
            shapes
        }
        "test-all-types" => vec![
            rectangle((12.0, 12.0), (47.0, 47.0), BLUE),
            rectangle((53.0, 12.0), (88.0, 47.0), ORANGE),
            rectangle((12.0, 53.0), (47.0, 88.0), GREEN),
            rectangle((53.0, 53.0), (88.0, 88.0), INK),
        ],
        _ => vec![disc((50.0, 50.0), 36.0, BLUE), disc((50.0, 50.0), 22.0, PALE)],
    }
}

/// The drawing as PNG, transparent where nothing is drawn.
pub fn png(model_name: &str) -> Vec<u8> {
    let shapes = drawing(model_name);
    let mut pixels = Vec::with_capacity(SIZE * SIZE * 4);
    for row in 0..SIZE {
        for column in 0..SIZE {
            pixels.extend(pixel(&shapes, row, column));
        }
    }
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, SIZE as u32, SIZE as u32);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    encoder
        .write_header()
        .and_then(|mut writer| writer.write_image_data(&pixels))
        .expect("the buffer in memory has the size of the image");
    bytes
}

/// Red, green, blue, alpha: the mean over the samples of one pixel.
fn pixel(shapes: &[(Shape, Color)], row: usize, column: usize) -> [u8; 4] {
    let coordinate =
        |i: usize, k: usize| (i as f64 + (k as f64 + 0.5) / SAMPLES as f64) * 100.0 / SIZE as f64;
    let (mut sum, mut covered) = ([0u32; 3], 0);
    for i in 0..SAMPLES {
        for k in 0..SAMPLES {
            let point = (coordinate(column, k), coordinate(row, i));
            if let Some((_, color)) = shapes.iter().rev().find(|(shape, _)| shape.contains(point)) {
                covered += 1;
                sum.iter_mut().zip(color).for_each(|(s, c)| *s += u32::from(*c));
            }
        }
    }
    let mean = sum.map(|s| s.checked_div(covered).unwrap_or(0) as u8);
    let alpha = covered * 255 / (SAMPLES * SAMPLES) as u32;
    [mean[0], mean[1], mean[2], alpha as u8]
}

#[cfg(test)]
mod tests {
    use super::*;
    use airloop_models::registry;
    use std::io::Cursor;

    #[test]
    fn every_model_has_its_own_readable_picture() {
        let mut seen: Vec<Vec<u8>> = Vec::new();
        for entry in registry::all() {
            let bytes = png(entry.identity.model_name);
            let mut reader = png::Decoder::new(Cursor::new(&bytes)).read_info().expect("a PNG");
            let mut pixels = vec![0; reader.output_buffer_size().expect("a small image")];
            let info = reader.next_frame(&mut pixels).expect("one frame");
            assert_eq!((info.width as usize, info.height as usize), (SIZE, SIZE));
            let opaque = pixels.chunks(4).filter(|p| p[3] == 255).count();
            assert!(opaque > SIZE * SIZE / 50, "{} is nearly empty", entry.identity.model_name);
            assert!(!seen.contains(&bytes), "{} looks like another", entry.identity.model_name);
            seen.push(bytes);
        }
    }
}
