//! Problems in three variables; source as in `two.rs`.

use crate::jet::Jet;
use crate::problem::Problem;

const INF: f64 = f64::INFINITY;

fn squares(x: &[Jet]) -> Jet {
    x.iter().fold(Jet::constant(0.0), |sum, &x| sum + x.powi(2))
}

pub fn problems() -> Vec<Problem> {
    vec![
        Problem::new("HS26", &[-2.6, 2.0, 2.0], &[0.0], |x| (x[0] - x[1]).powi(2) + (x[1] - x[2]).powi(4))
            .subject_to(1, 0, |x| vec![(1.0 + x[1].powi(2)) * x[0] + x[2].powi(4) - 3.0]),
        Problem::new("HS27", &[2.0; 3], &[0.04], |x| {
            0.01 * (x[0] - 1.0).powi(2) + (x[1] - x[0].powi(2)).powi(2)
        })
        .subject_to(1, 0, |x| vec![x[0] + x[2].powi(2) + 1.0]),
        Problem::new("HS28", &[-4.0, 1.0, 1.0], &[0.0], |x| (x[0] + x[1]).powi(2) + (x[1] + x[2]).powi(2))
            .subject_to(1, 0, |x| vec![x[0] + 2.0 * x[1] + 3.0 * x[2] - 1.0]),
        Problem::new("HS29", &[1.0; 3], &[-16.0 * 2f64.sqrt()], |x| -x[0] * x[1] * x[2]).subject_to(
            0,
            1,
            |x| vec![48.0 - x[0].powi(2) - 2.0 * x[1].powi(2) - 4.0 * x[2].powi(2)],
        ),
        Problem::new("HS30", &[1.0; 3], &[1.0], squares)
            .within(&[(1.0, 10.0), (-10.0, 10.0), (-10.0, 10.0)])
            .subject_to(0, 1, |x| vec![x[0].powi(2) + x[1].powi(2) - 1.0]),
        Problem::new("HS31", &[1.0; 3], &[6.0], |x| 9.0 * x[0].powi(2) + x[1].powi(2) + 9.0 * x[2].powi(2))
            .within(&[(-10.0, 10.0), (1.0, 10.0), (-10.0, 1.0)])
            .subject_to(0, 1, |x| vec![x[0] * x[1] - 1.0]),
        Problem::new("HS32", &[0.1, 0.7, 0.2], &[1.0], |x| {
            (x[0] + 3.0 * x[1] + x[2]).powi(2) + 4.0 * (x[0] - x[1]).powi(2)
        })
        .within(&[(0.0, INF); 3])
        .subject_to(1, 1, |x| vec![1.0 - x[0] - x[1] - x[2], 6.0 * x[1] + 4.0 * x[2] - x[0].powi(3) - 3.0]),
        Problem::new("HS33", &[0.0, 0.0, 3.0], &[2f64.sqrt() - 6.0], |x| {
            (x[0] - 1.0) * (x[0] - 2.0) * (x[0] - 3.0) + x[2]
        })
        .within(&[(0.0, INF), (0.0, INF), (0.0, 5.0)])
        .subject_to(0, 2, |x| vec![x[2].powi(2) - x[1].powi(2) - x[0].powi(2), squares(x) - 4.0]),
        Problem::new("HS34", &[0.0, 1.05, 2.9], &[-(10f64.ln().ln())], |x| -x[0])
            .within(&[(0.0, 100.0), (0.0, 100.0), (0.0, 10.0)])
            .subject_to(0, 2, |x| vec![x[1] - x[0].exp(), x[2] - x[1].exp()]),
        Problem::new("HS35", &[0.5; 3], &[1.0 / 9.0], |x| {
            9.0 - 8.0 * x[0] - 6.0 * x[1] - 4.0 * x[2]
                + 2.0 * x[0].powi(2)
                + 2.0 * x[1].powi(2)
                + x[2].powi(2)
                + 2.0 * x[0] * x[1]
                + 2.0 * x[0] * x[2]
        })
        .within(&[(0.0, INF); 3])
        .subject_to(0, 1, |x| vec![3.0 - x[0] - x[1] - 2.0 * x[2]]),
        Problem::new("HS36", &[10.0; 3], &[-3300.0], |x| -x[0] * x[1] * x[2])
            .within(&[(0.0, 20.0), (0.0, 11.0), (0.0, 42.0)])
            .subject_to(0, 1, |x| vec![72.0 - x[0] - 2.0 * x[1] - 2.0 * x[2]]),
        Problem::new("HS37", &[10.0; 3], &[-3456.0], |x| -x[0] * x[1] * x[2])
            .within(&[(0.0, 42.0); 3])
            .subject_to(0, 2, |x| {
                let sum = x[0] + 2.0 * x[1] + 2.0 * x[2];
                vec![72.0 - sum, sum]
            }),
        Problem::new("HS60", &[2.0; 3], &[0.032_568_200_25], |x| {
            (x[0] - 1.0).powi(2) + (x[0] - x[1]).powi(2) + (x[1] - x[2]).powi(4)
        })
        .within(&[(-10.0, 10.0); 3])
        .subject_to(1, 0, |x| vec![x[0] * (1.0 + x[1].powi(2)) + x[2].powi(4) - 4.0 - 3.0 * 2f64.sqrt()]),
        Problem::new("HS61", &[0.0; 3], &[-143.646_142_2], |x| {
            4.0 * x[0].powi(2) + 2.0 * x[1].powi(2) + 2.0 * x[2].powi(2) - 33.0 * x[0] + 16.0 * x[1]
                - 24.0 * x[2]
        })
        .subject_to(2, 0, |x| vec![3.0 * x[0] - 2.0 * x[1].powi(2) - 7.0, 4.0 * x[0] - x[2].powi(2) - 11.0]),
        Problem::new("HS62", &[0.7, 0.2, 0.1], &[-26_272.514_48], |x| {
            let [a, b, c] = [x[0] + x[1] + x[2] + 0.03, x[1] + x[2] + 0.03, x[2] + 0.03];
            let first = (a / (0.09 * x[0] + b)).ln();
            let second = (b / (0.07 * x[1] + c)).ln();
            let third = (c / (0.13 * x[2] + 0.03)).ln();
            -32.174 * (255.0 * first + 280.0 * second + 290.0 * third)
        })
        .within(&[(0.0, 1.0); 3])
        .subject_to(1, 0, |x| vec![x[0] + x[1] + x[2] - 1.0]),
        Problem::new("HS63", &[2.0; 3], &[961.715_172_1], |x| {
            1000.0 - x[0].powi(2) - 2.0 * x[1].powi(2) - x[2].powi(2) - x[0] * x[1] - x[0] * x[2]
        })
        .within(&[(0.0, INF); 3])
        .subject_to(2, 0, |x| vec![8.0 * x[0] + 14.0 * x[1] + 7.0 * x[2] - 56.0, squares(x) - 25.0]),
        Problem::new("HS64", &[1.0; 3], &[6_299.842_428], |x| {
            5.0 * x[0] + 5e4 / x[0] + 20.0 * x[1] + 7.2e4 / x[1] + 10.0 * x[2] + 1.44e5 / x[2]
        })
        .within(&[(1e-5, 300.0); 3])
        .subject_to(0, 1, |x| vec![1.0 - 4.0 / x[0] - 32.0 / x[1] - 120.0 / x[2]]),
        Problem::new("HS65", &[-5.0, 5.0, 0.0], &[0.953_528_856_7], |x| {
            (x[0] - x[1]).powi(2) + (x[0] + x[1] - 10.0).powi(2) / 9.0 + (x[2] - 5.0).powi(2)
        })
        .within(&[(-4.5, 4.5), (-4.5, 4.5), (-5.0, 5.0)])
        .subject_to(0, 1, |x| vec![48.0 - squares(x)]),
        Problem::new("HS66", &[0.0, 1.05, 2.9], &[0.518_163_274_1], |x| 0.2 * x[2] - 0.8 * x[0])
            .within(&[(0.0, 100.0), (0.0, 100.0), (0.0, 10.0)])
            .subject_to(0, 2, |x| vec![x[1] - x[0].exp(), x[2] - x[1].exp()]),
    ]
}
