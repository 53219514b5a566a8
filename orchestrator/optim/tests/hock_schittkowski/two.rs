//! Problems in two variables. Numbers, starts and minima as in Hock and Schittkowski, Test Examples for Nonlinear
//! Programming Codes, Springer, 1981.

use std::f64::consts::PI;

use crate::jet::Jet;
use crate::problem::Problem;

const INF: f64 = f64::INFINITY;

fn rosenbrock(x: &[Jet]) -> Jet {
    100.0 * (x[1] - x[0].powi(2)).powi(2) + (1.0 - x[0]).powi(2)
}

pub fn problems() -> Vec<Problem> {
    let start = [-2.0, 1.0];
    vec![
        Problem::new("HS1", &start, &[0.0], rosenbrock).within(&[(-INF, INF), (-1.5, INF)]),
        Problem::new("HS2", &start, &[0.050_426_187_9, 4.941_229_318], rosenbrock)
            .within(&[(-INF, INF), (1.5, INF)]),
        Problem::new("HS3", &[10.0, 1.0], &[0.0], |x| x[1] + 1e-5 * (x[1] - x[0]).powi(2))
            .within(&[(-INF, INF), (0.0, INF)]),
        Problem::new("HS4", &[1.125, 0.125], &[8.0 / 3.0], |x| (x[0] + 1.0).powi(3) / 3.0 + x[1])
            .within(&[(1.0, INF), (0.0, INF)]),
        Problem::new("HS5", &[0.0, 0.0], &[-(3f64.sqrt()) / 2.0 - PI / 3.0], |x| {
            (x[0] + x[1]).sin() + (x[0] - x[1]).powi(2) - 1.5 * x[0] + 2.5 * x[1] + 1.0
        })
        .within(&[(-1.5, 4.0), (-3.0, 3.0)]),
        Problem::new("HS6", &[-1.2, 1.0], &[0.0], |x| (1.0 - x[0]).powi(2))
            .subject_to(1, 0, |x| vec![10.0 * (x[1] - x[0].powi(2))]),
        Problem::new("HS7", &[2.0, 2.0], &[-(3f64.sqrt())], |x| (1.0 + x[0].powi(2)).ln() - x[1]).subject_to(
            1,
            0,
            |x| vec![(1.0 + x[0].powi(2)).powi(2) + x[1].powi(2) - 4.0],
        ),
        Problem::new("HS8", &[2.0, 1.0], &[-1.0], |_| Jet::constant(-1.0))
            .subject_to(2, 0, |x| vec![x[0].powi(2) + x[1].powi(2) - 25.0, x[0] * x[1] - 9.0]),
        Problem::new("HS9", &[0.0, 0.0], &[-0.5], |x| (x[0] * PI / 12.0).sin() * (x[1] * PI / 16.0).cos())
            .subject_to(1, 0, |x| vec![4.0 * x[0] - 3.0 * x[1]]),
        Problem::new("HS10", &[-10.0, 10.0], &[-1.0], |x| x[0] - x[1])
            .subject_to(0, 1, |x| vec![-3.0 * x[0].powi(2) + 2.0 * x[0] * x[1] - x[1].powi(2) + 1.0]),
        Problem::new("HS11", &[4.9, 0.1], &[-8.498_464_223], |x| (x[0] - 5.0).powi(2) + x[1].powi(2) - 25.0)
            .subject_to(0, 1, |x| vec![x[1] - x[0].powi(2)]),
        Problem::new("HS12", &[0.0, 0.0], &[-30.0], |x| {
            0.5 * x[0].powi(2) + x[1].powi(2) - x[0] * x[1] - 7.0 * x[0] - 7.0 * x[1]
        })
        .subject_to(0, 1, |x| vec![25.0 - 4.0 * x[0].powi(2) - x[1].powi(2)]),
        // The minimum has no multipliers (the constraint qualification fails there).
        Problem::new("HS13", &[-2.0, -2.0], &[1.0], |x| (x[0] - 2.0).powi(2) + x[1].powi(2))
            .within(&[(0.0, INF); 2])
            .subject_to(0, 1, |x| vec![(1.0 - x[0]).powi(3) - x[1]]),
        Problem::new("HS14", &[2.0, 2.0], &[9.0 - 2.875 * 7f64.sqrt()], |x| {
            (x[0] - 2.0).powi(2) + (x[1] - 1.0).powi(2)
        })
        .subject_to(1, 1, |x| vec![x[0] - 2.0 * x[1] + 1.0, 1.0 - 0.25 * x[0].powi(2) - x[1].powi(2)]),
        Problem::new("HS15", &start, &[306.5], rosenbrock).within(&[(-INF, 0.5), (-INF, INF)]).subject_to(
            0,
            2,
            |x| vec![x[0] * x[1] - 1.0, x[0] + x[1].powi(2)],
        ),
        Problem::new("HS16", &start, &[0.25, 23.144_661_0], rosenbrock)
            .within(&[(-0.5, 0.5), (-INF, 1.0)])
            .subject_to(0, 2, |x| vec![x[0] + x[1].powi(2), x[0].powi(2) + x[1]]),
        Problem::new("HS17", &start, &[1.0], rosenbrock).within(&[(-0.5, 0.5), (-INF, 1.0)]).subject_to(
            0,
            2,
            |x| vec![x[1].powi(2) - x[0], x[0].powi(2) - x[1]],
        ),
        Problem::new("HS18", &[2.0, 2.0], &[5.0], |x| 0.01 * x[0].powi(2) + x[1].powi(2))
            .within(&[(2.0, 50.0), (0.0, 50.0)])
            .subject_to(0, 2, |x| vec![x[0] * x[1] - 25.0, x[0].powi(2) + x[1].powi(2) - 25.0]),
        Problem::new("HS19", &[20.1, 5.84], &[-6_961.813_88], |x| {
            (x[0] - 10.0).powi(3) + (x[1] - 20.0).powi(3)
        })
        .within(&[(13.0, 100.0), (0.0, 100.0)])
        .subject_to(0, 2, |x| {
            vec![
                (x[0] - 5.0).powi(2) + (x[1] - 5.0).powi(2) - 100.0,
                82.81 - (x[1] - 5.0).powi(2) - (x[0] - 6.0).powi(2),
            ]
        }),
        Problem::new("HS20", &start, &[81.5 - 25.0 * 3f64.sqrt(), 40.198_729_8], rosenbrock)
            .within(&[(-0.5, 0.5), (-INF, INF)])
            .subject_to(0, 3, |x| {
                vec![x[0] + x[1].powi(2), x[0].powi(2) + x[1], x[0].powi(2) + x[1].powi(2) - 1.0]
            }),
        Problem::new("HS21", &[-1.0, -1.0], &[-99.96], |x| 0.01 * x[0].powi(2) + x[1].powi(2) - 100.0)
            .within(&[(2.0, 50.0), (-50.0, 50.0)])
            .subject_to(0, 1, |x| vec![10.0 * x[0] - x[1] - 10.0]),
        Problem::new("HS22", &[2.0, 2.0], &[1.0], |x| (x[0] - 2.0).powi(2) + (x[1] - 1.0).powi(2))
            .subject_to(0, 2, |x| vec![2.0 - x[0] - x[1], x[1] - x[0].powi(2)]),
        Problem::new("HS23", &[3.0, 1.0], &[2.0], |x| x[0].powi(2) + x[1].powi(2))
            .within(&[(-50.0, 50.0); 2])
            .subject_to(0, 5, |x| {
                vec![
                    x[0] + x[1] - 1.0,
                    x[0].powi(2) + x[1].powi(2) - 1.0,
                    9.0 * x[0].powi(2) + x[1].powi(2) - 9.0,
                    x[0].powi(2) - x[1],
                    x[1].powi(2) - x[0],
                ]
            }),
        Problem::new("HS24", &[1.0, 0.5], &[-1.0], |x| {
            ((x[0] - 3.0).powi(2) - 9.0) * x[1].powi(3) / (27.0 * 3f64.sqrt())
        })
        .within(&[(0.0, INF); 2])
        .subject_to(0, 3, |x| {
            let r = 3f64.sqrt();
            vec![x[0] / r - x[1], x[0] + r * x[1], 6.0 - x[0] - r * x[1]]
        }),
    ]
}
