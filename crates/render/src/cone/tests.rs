//! Heights and outlines against the slow forms.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

use super::*;

fn ball(x: f64, y: f64, z: f64, radius: f64) -> Ball {
    Ball { center: DVec3::new(x, y, z), radius }
}

/// The slow form: the highest of many spheres along the axis.
fn highest_sphere(start: Ball, end: Ball, pixel: Vec2) -> Option<f64> {
    let n = 20_000;
    (0..=n)
        .filter_map(|i| {
            let s = f64::from(i) / f64::from(n);
            let center = start.center.lerp(end.center, s);
            let radius = start.radius + s * (end.radius - start.radius);
            let g = radius * radius - (pixel.as_dvec2() - center.truncate()).length_squared();
            (g >= 0.0).then(|| center.z + g.sqrt())
        })
        .max_by(f64::total_cmp)
}

#[test]
fn height_is_the_highest_sphere() {
    let cases = [
        (ball(10.0, 10.0, 0.0, 4.0), ball(30.0, 18.0, 0.0, 4.0)),
        (ball(10.0, 10.0, 0.0, 6.0), ball(30.0, 18.0, 0.0, 2.0)),
        (ball(10.0, 10.0, -3.0, 3.0), ball(26.0, 20.0, 9.0, 5.0)),
        (ball(20.0, 15.0, -9.0, 6.0), ball(20.5, 15.2, 9.0, 3.0)),
        (ball(20.0, 15.0, 0.0, 2.0), ball(21.0, 15.0, 0.0, 7.0)),
        (ball(20.0, 15.0, 4.0, 5.0), ball(20.0, 15.0, -8.0, 5.0)),
    ];
    for (start, end) in cases {
        let cone = Cone::new(start, end, [Joint::End; 2]);
        let mut n_inside = 0;
        for y in 0..30 {
            for x in 0..45 {
                let pixel = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                let hit = cone.at(pixel, 0.0);
                let Some(expected) = highest_sphere(start, end, pixel) else {
                    assert!(hit.is_none_or(|hit| hit.outside > -0.01), "{start:?} {end:?} {pixel}");
                    continue;
                };
                n_inside += 1;
                if let Some(hit) = hit {
                    let rim = hit.outside > -0.05;
                    assert!(rim || (f64::from(hit.z) - expected).abs() < 2e-2, "{pixel} {hit:?} {expected}");
                }
                let (from, to) = cone.span(pixel.y, 0.0).expect("a row inside");
                assert!(from <= pixel.x && pixel.x <= to, "{pixel} outside {from}..{to}");
            }
        }
        assert!(n_inside > 20);
    }
}

#[test]
fn outline_distance_is_right() {
    let cone = Cone::new(ball(10.0, 10.0, 0.0, 4.0), ball(30.0, 10.0, 0.0, 4.0), [Joint::End; 2]);
    let outside = |x: f32, y: f32| cone.at(Vec2::new(x, y), 5.0).expect("near").outside;
    assert!((outside(20.0, 10.0) + 4.0).abs() < 1e-5);
    assert!((outside(20.0, 15.0) - 1.0).abs() < 1e-5);
    assert!((outside(34.5, 10.0) - 0.5).abs() < 1e-5);
}
