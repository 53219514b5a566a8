//! Problems in four to ten variables; source as in `two.rs`.

use crate::jet::Jet;
use crate::problem::Problem;

const INF: f64 = f64::INFINITY;

fn squares(x: &[Jet]) -> Jet {
    x.iter().fold(Jet::constant(0.0), |sum, &x| sum + x.powi(2))
}

fn sum(x: &[Jet]) -> Jet {
    x.iter().fold(Jet::constant(0.0), |sum, &x| sum + x)
}

fn product(x: &[Jet]) -> Jet {
    x.iter().fold(Jet::constant(1.0), |product, &x| product * x)
}

/// Constraints of HS51 to HS53, the first with its right-hand side.
fn linear(x: &[Jet], first: f64) -> Vec<Jet> {
    vec![x[0] + 3.0 * x[1] - first, x[2] + x[3] - 2.0 * x[4], x[1] - x[4]]
}

/// Constraints of HS78, HS80 and HS81.
fn sphere_and_products(x: &[Jet]) -> Vec<Jet> {
    vec![squares(x) - 10.0, x[1] * x[2] - 5.0 * x[3] * x[4], x[0].powi(3) + x[1].powi(3) + 1.0]
}

pub fn problems() -> Vec<Problem> {
    let mut all = four();
    all.extend(five());
    all.extend(larger());
    all
}

fn four() -> Vec<Problem> {
    vec![
        Problem::new("HS38", &[-3.0, -1.0, -3.0, -1.0], &[0.0], |x| {
            100.0 * (x[1] - x[0].powi(2)).powi(2)
                + (1.0 - x[0]).powi(2)
                + 90.0 * (x[3] - x[2].powi(2)).powi(2)
                + (1.0 - x[2]).powi(2)
                + 10.1 * ((x[1] - 1.0).powi(2) + (x[3] - 1.0).powi(2))
                + 19.8 * (x[1] - 1.0) * (x[3] - 1.0)
        })
        .within(&[(-10.0, 10.0); 4]),
        Problem::new("HS39", &[2.0; 4], &[-1.0], |x| -x[0]).subject_to(2, 0, |x| {
            vec![x[1] - x[0].powi(3) - x[2].powi(2), x[0].powi(2) - x[1] - x[3].powi(2)]
        }),
        Problem::new("HS40", &[0.8; 4], &[-0.25], |x| -product(x)).subject_to(3, 0, |x| {
            vec![x[0].powi(3) + x[1].powi(2) - 1.0, x[0].powi(2) * x[3] - x[2], x[3].powi(2) - x[1]]
        }),
        Problem::new("HS41", &[2.0; 4], &[52.0 / 27.0], |x| 2.0 - x[0] * x[1] * x[2])
            .within(&[(0.0, 1.0), (0.0, 1.0), (0.0, 1.0), (0.0, 2.0)])
            .subject_to(1, 0, |x| vec![x[0] + 2.0 * x[1] + 2.0 * x[2] - x[3]]),
        Problem::new("HS42", &[1.0; 4], &[28.0 - 10.0 * 2f64.sqrt()], |x| {
            (x[0] - 1.0).powi(2) + (x[1] - 2.0).powi(2) + (x[2] - 3.0).powi(2) + (x[3] - 4.0).powi(2)
        })
        .subject_to(2, 0, |x| vec![x[0] - 2.0, x[2].powi(2) + x[3].powi(2) - 2.0]),
        Problem::new("HS43", &[0.0; 4], &[-44.0], |x| {
            x[0].powi(2) + x[1].powi(2) + 2.0 * x[2].powi(2) + x[3].powi(2)
                - 5.0 * x[0]
                - 5.0 * x[1]
                - 21.0 * x[2]
                + 7.0 * x[3]
        })
        .subject_to(0, 3, |x| {
            let q: Vec<Jet> = x.iter().map(|x| x.powi(2)).collect();
            vec![
                8.0 - q[0] - q[1] - q[2] - q[3] - x[0] + x[1] - x[2] + x[3],
                10.0 - q[0] - 2.0 * q[1] - q[2] - 2.0 * q[3] + x[0] + x[3],
                5.0 - 2.0 * q[0] - q[1] - q[2] - 2.0 * x[0] + x[1] + x[3],
            ]
        }),
        Problem::new("HS44", &[0.0; 4], &[-15.0, -13.0], |x| {
            x[0] - x[1] - x[2] - x[0] * x[2] + x[0] * x[3] + x[1] * x[2] - x[1] * x[3]
        })
        .within(&[(0.0, INF); 4])
        .subject_to(0, 6, |x| {
            vec![
                8.0 - x[0] - 2.0 * x[1],
                12.0 - 4.0 * x[0] - x[1],
                12.0 - 3.0 * x[0] - 4.0 * x[1],
                8.0 - 2.0 * x[2] - x[3],
                8.0 - x[2] - 2.0 * x[3],
                5.0 - x[2] - x[3],
            ]
        }),
        Problem::new("HS71", &[1.0, 5.0, 5.0, 1.0], &[17.014_017_3], |x| {
            x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2]
        })
        .within(&[(1.0, 5.0); 4])
        .subject_to(1, 1, |x| vec![squares(x) - 40.0, product(x) - 25.0]),
        Problem::new("HS72", &[1.0; 4], &[727.679_37], |x| 1.0 + sum(x))
            .within(&[(1e-3, 4e5), (1e-3, 3e5), (1e-3, 2e5), (1e-3, 1e5)])
            .subject_to(0, 2, |x| {
                vec![
                    0.0401 - 4.0 / x[0] - 2.25 / x[1] - 1.0 / x[2] - 0.25 / x[3],
                    0.010_085 - 0.16 / x[0] - 0.36 / x[1] - 0.64 / x[2] - 0.64 / x[3],
                ]
            }),
        Problem::new("HS73", &[1.0; 4], &[29.894_378_16], |x| {
            24.55 * x[0] + 26.75 * x[1] + 39.0 * x[2] + 40.5 * x[3]
        })
        .within(&[(0.0, INF); 4])
        .subject_to(1, 2, |x| {
            let spread =
                0.28 * x[0].powi(2) + 0.19 * x[1].powi(2) + 20.5 * x[2].powi(2) + 0.62 * x[3].powi(2);
            vec![
                sum(x) - 1.0,
                2.3 * x[0] + 5.6 * x[1] + 11.1 * x[2] + 1.3 * x[3] - 5.0,
                12.0 * x[0] + 11.9 * x[1] + 41.8 * x[2] + 52.1 * x[3] - 21.0 - 1.645 * spread.sqrt(),
            ]
        }),
        Problem::new("HS76", &[0.5; 4], &[-4.681_818_182], |x| {
            x[0].powi(2) + 0.5 * x[1].powi(2) + x[2].powi(2) + 0.5 * x[3].powi(2) - x[0] * x[2] + x[2] * x[3]
                - x[0]
                - 3.0 * x[1]
                + x[2]
                - x[3]
        })
        .within(&[(0.0, INF); 4])
        .subject_to(0, 3, |x| {
            vec![
                5.0 - x[0] - 2.0 * x[1] - x[2] - x[3],
                4.0 - 3.0 * x[0] - x[1] - 2.0 * x[2] + x[3],
                x[1] + 4.0 * x[2] - 1.5,
            ]
        }),
    ]
}

fn five() -> Vec<Problem> {
    vec![
        Problem::new("HS45", &[2.0; 5], &[1.0], |x| 2.0 - product(x) / 120.0).within(&[
            (0.0, 1.0),
            (0.0, 2.0),
            (0.0, 3.0),
            (0.0, 4.0),
            (0.0, 5.0),
        ]),
        Problem::new("HS46", &[0.5f64.sqrt(), 1.75, 0.5, 2.0, 2.0], &[0.0], |x| {
            (x[0] - x[1]).powi(2) + (x[2] - 1.0).powi(2) + (x[3] - 1.0).powi(4) + (x[4] - 1.0).powi(6)
        })
        .subject_to(2, 0, |x| {
            vec![x[0].powi(2) * x[3] + (x[3] - x[4]).sin() - 1.0, x[1] + x[2].powi(4) * x[3].powi(2) - 2.0]
        }),
        Problem::new("HS48", &[3.0, 5.0, -3.0, 2.0, -2.0], &[0.0], |x| {
            (x[0] - 1.0).powi(2) + (x[1] - x[2]).powi(2) + (x[3] - x[4]).powi(2)
        })
        .subject_to(2, 0, |x| vec![sum(x) - 5.0, x[2] - 2.0 * (x[3] + x[4]) + 3.0]),
        Problem::new("HS49", &[10.0, 7.0, 2.0, -3.0, 0.8], &[0.0], |x| {
            (x[0] - x[1]).powi(2) + (x[2] - 1.0).powi(2) + (x[3] - 1.0).powi(4) + (x[4] - 1.0).powi(6)
        })
        .subject_to(2, 0, |x| vec![x[0] + x[1] + x[2] + 4.0 * x[3] - 7.0, x[2] + 5.0 * x[4] - 6.0]),
        Problem::new("HS50", &[35.0, -31.0, 11.0, 5.0, -5.0], &[0.0], |x| {
            (x[0] - x[1]).powi(2) + (x[1] - x[2]).powi(2) + (x[2] - x[3]).powi(4) + (x[3] - x[4]).powi(2)
        })
        .subject_to(3, 0, |x| (0..3).map(|i| x[i] + 2.0 * x[i + 1] + 3.0 * x[i + 2] - 6.0).collect()),
        Problem::new("HS51", &[2.5, 0.5, 2.0, -1.0, 0.5], &[0.0], |x| (x[0] - x[1]).powi(2) + tail(x))
            .subject_to(3, 0, |x| linear(x, 4.0)),
        Problem::new("HS52", &[2.0; 5], &[1859.0 / 349.0], |x| (4.0 * x[0] - x[1]).powi(2) + tail(x))
            .subject_to(3, 0, |x| linear(x, 0.0)),
        Problem::new("HS53", &[2.0; 5], &[176.0 / 43.0], |x| (x[0] - x[1]).powi(2) + tail(x))
            .within(&[(-10.0, 10.0); 5])
            .subject_to(3, 0, |x| linear(x, 0.0)),
        Problem::new("HS77", &[2.0; 5], &[0.241_505_128_7], |x| {
            (x[0] - 1.0).powi(2)
                + (x[0] - x[1]).powi(2)
                + (x[2] - 1.0).powi(2)
                + (x[3] - 1.0).powi(4)
                + (x[4] - 1.0).powi(6)
        })
        .subject_to(2, 0, |x| {
            vec![
                x[0].powi(2) * x[3] + (x[3] - x[4]).sin() - 2.0 * 2f64.sqrt(),
                x[1] + x[2].powi(4) * x[3].powi(2) - 8.0 - 2f64.sqrt(),
            ]
        }),
        Problem::new("HS78", &[-2.0, 1.5, 2.0, -1.0, -1.0], &[-2.919_700_41], product).subject_to(
            3,
            0,
            sphere_and_products,
        ),
        Problem::new("HS79", &[2.0; 5], &[0.078_776_820_9], |x| {
            (x[0] - 1.0).powi(2)
                + (x[0] - x[1]).powi(2)
                + (x[1] - x[2]).powi(2)
                + (x[2] - x[3]).powi(4)
                + (x[3] - x[4]).powi(4)
        })
        .subject_to(3, 0, |x| {
            let r = 2f64.sqrt();
            vec![
                x[0] + x[1].powi(2) + x[2].powi(3) - 2.0 - 3.0 * r,
                x[1] - x[2].powi(2) + x[3] + 2.0 - 2.0 * r,
                x[0] * x[4] - 2.0,
            ]
        }),
        Problem::new("HS80", &[-2.0, 2.0, 2.0, -1.0, -1.0], &[0.053_949_847_8], |x| product(x).exp())
            .within(&[(-2.3, 2.3), (-2.3, 2.3), (-3.2, 3.2), (-3.2, 3.2), (-3.2, 3.2)])
            .subject_to(3, 0, sphere_and_products),
        Problem::new("HS81", &[-2.0, 2.0, 2.0, -1.0, -1.0], &[0.053_949_847_8], |x| {
            product(x).exp() - 0.5 * (x[0].powi(3) + x[1].powi(3) + 1.0).powi(2)
        })
        .within(&[(-2.3, 2.3), (-2.3, 2.3), (-3.2, 3.2), (-3.2, 3.2), (-3.2, 3.2)])
        .subject_to(3, 0, sphere_and_products),
    ]
}

/// Common part of the objectives of HS51 to HS53.
fn tail(x: &[Jet]) -> Jet {
    (x[1] + x[2] - 2.0).powi(2) + (x[3] - 1.0).powi(2) + (x[4] - 1.0).powi(2)
}

fn larger() -> Vec<Problem> {
    let (a, b) = ((1.0f64 / 4.2).sqrt().asin(), (5.0f64 / 7.2).sqrt().asin());
    vec![
        Problem::new("HS56", &[1.0, 1.0, 1.0, a, a, a, b], &[-3.456], |x| -x[0] * x[1] * x[2]).subject_to(
            4,
            0,
            |x| {
                vec![
                    x[0] - 4.2 * x[3].sin().powi(2),
                    x[1] - 4.2 * x[4].sin().powi(2),
                    x[2] - 4.2 * x[5].sin().powi(2),
                    x[0] + 2.0 * x[1] + 2.0 * x[2] - 7.2 * x[6].sin().powi(2),
                ]
            },
        ),
        Problem::new("HS100", &[1.0, 2.0, 0.0, 4.0, 0.0, 1.0, 1.0], &[680.630_057_3], |x| {
            (x[0] - 10.0).powi(2)
                + 5.0 * (x[1] - 12.0).powi(2)
                + x[2].powi(4)
                + 3.0 * (x[3] - 11.0).powi(2)
                + 10.0 * x[4].powi(6)
                + 7.0 * x[5].powi(2)
                + x[6].powi(4)
                - 4.0 * x[5] * x[6]
                - 10.0 * x[5]
                - 8.0 * x[6]
        })
        .subject_to(0, 4, |x| {
            vec![
                127.0 - 2.0 * x[0].powi(2) - 3.0 * x[1].powi(4) - x[2] - 4.0 * x[3].powi(2) - 5.0 * x[4],
                282.0 - 7.0 * x[0] - 3.0 * x[1] - 10.0 * x[2].powi(2) - x[3] + x[4],
                196.0 - 23.0 * x[0] - x[1].powi(2) - 6.0 * x[5].powi(2) + 8.0 * x[6],
                -4.0 * x[0].powi(2) - x[1].powi(2) + 3.0 * x[0] * x[1] - 2.0 * x[2].powi(2) - 5.0 * x[5]
                    + 11.0 * x[6],
            ]
        }),
        Problem::new("HS113", &[2.0, 3.0, 5.0, 5.0, 1.0, 2.0, 7.0, 3.0, 6.0, 10.0], &[24.306_209_1], |x| {
            x[0].powi(2) + x[1].powi(2) + x[0] * x[1] - 14.0 * x[0] - 16.0 * x[1]
                + (x[2] - 10.0).powi(2)
                + 4.0 * (x[3] - 5.0).powi(2)
                + (x[4] - 3.0).powi(2)
                + 2.0 * (x[5] - 1.0).powi(2)
                + 5.0 * x[6].powi(2)
                + 7.0 * (x[7] - 11.0).powi(2)
                + 2.0 * (x[8] - 10.0).powi(2)
                + (x[9] - 7.0).powi(2)
                + 45.0
        })
        .subject_to(0, 8, |x| {
            vec![
                105.0 - 4.0 * x[0] - 5.0 * x[1] + 3.0 * x[6] - 9.0 * x[7],
                -10.0 * x[0] + 8.0 * x[1] + 17.0 * x[6] - 2.0 * x[7],
                8.0 * x[0] - 2.0 * x[1] - 5.0 * x[8] + 2.0 * x[9] + 12.0,
                -3.0 * (x[0] - 2.0).powi(2) - 4.0 * (x[1] - 3.0).powi(2) - 2.0 * x[2].powi(2)
                    + 7.0 * x[3]
                    + 120.0,
                -5.0 * x[0].powi(2) - 8.0 * x[1] - (x[2] - 6.0).powi(2) + 2.0 * x[3] + 40.0,
                -0.5 * (x[0] - 8.0).powi(2) - 2.0 * (x[1] - 4.0).powi(2) - 3.0 * x[4].powi(2) + x[5] + 30.0,
                -(x[0].powi(2)) - 2.0 * (x[1] - 2.0).powi(2) + 2.0 * x[0] * x[1] - 14.0 * x[4] + 6.0 * x[5],
                3.0 * x[0] - 6.0 * x[1] - 12.0 * (x[8] - 8.0).powi(2) + 7.0 * x[9],
            ]
        }),
    ]
}
