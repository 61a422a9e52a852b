//! The motion that brings points onto others with the least sum of squares.
//!
//! **Input** pairs of points, a motion to stay near where the points leave it open. **Output** the motion, with the mean
//! and the largest distance that it leaves.
//! **Steps** 1. Centre both sets. 2. The unit quaternion of the rotation is the eigenvector of the largest eigenvalue of a
//! symmetric 4 × 4 matrix made of their correlations, found by Jacobi's rotations. 3. The scale, if asked for, is the
//! ratio of the turned correlation to the spread of the moved set.
//! **Guarantees** a proper rotation, also for points in a plane, on a line or in one place: there a millionth of the
//! correlations asks for the rotation given.
//! **Source** [Horn1987]. **Cost** O(points).

use espalier_model::Alignment;
use glam::{DMat3, DQuat, DVec3};

use crate::params::Align;

/// How much the rotation given counts, as a share of all correlations.
const INERTIA: f64 = 1e-6;
/// Sweeps of Jacobi's method; it converges quadratically, after five or six.
const N_SWEEPS: usize = 24;

/// The motion that brings the second of each pair onto the first.
pub(crate) fn fit(pairs: &[(DVec3, DVec3)], align: Align, near: &Alignment) -> Alignment {
    let n_points = pairs.len();
    if align == Align::AsIs || n_points == 0 {
        return measured(*near, pairs, if align == Align::AsIs { 0 } else { n_points });
    }
    let count = n_points as f64;
    let to_mean = pairs.iter().map(|pair| pair.0).sum::<DVec3>() / count;
    let from_mean = pairs.iter().map(|pair| pair.1).sum::<DVec3>() / count;
    // Correlations: column j holds the sums of from · to_j.
    let (mut correlation, mut spread) = (DMat3::ZERO, 0.0);
    for &(to, from) in pairs {
        let (to, from) = (to - to_mean, from - from_mean);
        correlation += DMat3::from_cols(from * to.x, from * to.y, from * to.z);
        spread += from.length_squared();
    }
    let size = correlation.to_cols_array().into_iter().fold(0.0_f64, |size, part| size.max(part.abs()));
    let inertia = if size > 0.0 { INERTIA * size } else { 1.0 };
    let rotation = rotation(&(correlation + near.rotation.transpose() * inertia));
    let turned: f64 = pairs.iter().map(|&(to, from)| (to - to_mean).dot(rotation * (from - from_mean))).sum();
    let scale =
        if align == Align::Similarity && spread > 0.0 && turned > 0.0 { turned / spread } else { 1.0 };
    let translation_mm = to_mean - scale * (rotation * from_mean);
    measured(Alignment { rotation, translation_mm, scale, ..Alignment::IDENTITY }, pairs, n_points)
}

/// A motion with the distances that it leaves.
fn measured(motion: Alignment, pairs: &[(DVec3, DVec3)], n_points: usize) -> Alignment {
    let distances = || pairs.iter().map(|&(to, from)| to.distance(motion.apply(from)));
    let residual_mean_mm = distances().sum::<f64>() / pairs.len() as f64;
    let residual_max_mm = distances().fold(f64::NAN, f64::max);
    Alignment { n_points, residual_mean_mm, residual_max_mm, ..motion }
}

/// The rotation that agrees best with correlations (column j: the sums of from · to_j).
fn rotation(correlation: &DMat3) -> DMat3 {
    let s = |from: usize, to: usize| correlation.col(to)[from];
    let upper: [[f64; 4]; 4] = [
        [s(0, 0) + s(1, 1) + s(2, 2), s(1, 2) - s(2, 1), s(2, 0) - s(0, 2), s(0, 1) - s(1, 0)],
        [0.0, s(0, 0) - s(1, 1) - s(2, 2), s(0, 1) + s(1, 0), s(2, 0) + s(0, 2)],
        [0.0, 0.0, s(1, 1) - s(0, 0) - s(2, 2), s(1, 2) + s(2, 1)],
        [0.0, 0.0, 0.0, s(2, 2) - s(0, 0) - s(1, 1)],
    ];
    let size = upper.iter().flatten().fold(f64::MIN_POSITIVE, |size, part| size.max(part.abs()));
    let matrix: [[f64; 4]; 4] =
        std::array::from_fn(|i| std::array::from_fn(|j| upper[i.min(j)][i.max(j)] / size));
    let [w, x, y, z] = largest_eigenvector(matrix);
    DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize())
}

/// The eigenvector of the largest eigenvalue of a symmetric matrix.
fn largest_eigenvector(mut a: [[f64; 4]; 4]) -> [f64; 4] {
    let mut vectors: [[f64; 4]; 4] =
        std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    for _ in 0..N_SWEEPS {
        for p in 0..3 {
            for q in p + 1..4 {
                if a[p][q] == 0.0 {
                    continue;
                }
                // The rotation that takes a[p][q] to 0, by the smaller of its two angles.
                let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let tangent = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
                let sine = tangent * cosine;
                for row in &mut a {
                    (row[p], row[q]) = (cosine * row[p] - sine * row[q], sine * row[p] + cosine * row[q]);
                }
                let (row_p, row_q) = (a[p], a[q]);
                a[p] = std::array::from_fn(|k| cosine * row_p[k] - sine * row_q[k]);
                a[q] = std::array::from_fn(|k| sine * row_p[k] + cosine * row_q[k]);
                for row in &mut vectors {
                    (row[p], row[q]) = (cosine * row[p] - sine * row[q], sine * row[p] + cosine * row[q]);
                }
            }
        }
    }
    let best = (1..4).fold(0, |best, i| if a[i][i] > a[best][best] { i } else { best });
    std::array::from_fn(|row| vectors[row][best])
}

#[cfg(test)]
mod tests {
    use espalier_geom::random::{Purpose, Stream};

    use super::*;

    fn cloud(n: usize, key: u64) -> Vec<DVec3> {
        let mut stream = Stream::new(key, Purpose::PhantomShape, 0, 0);
        (0..n).map(|_| DVec3::from_array(std::array::from_fn(|_| stream.uniform(-50.0, 80.0)))).collect()
    }

    #[test]
    fn a_known_motion_is_found_again() {
        for key in 0..40 {
            let axis = DVec3::new(1.0, 0.3 * key as f64, -2.0).normalize();
            let motion = Alignment {
                rotation: DMat3::from_axis_angle(axis, 0.16 * key as f64),
                translation_mm: DVec3::new(3.0, -400.0, 0.5),
                scale: 1.0 + 0.01 * key as f64,
                ..Alignment::IDENTITY
            };
            let inverse =
                |to: DVec3| motion.rotation.transpose() * (to - motion.translation_mm) / motion.scale;
            let pairs: Vec<_> = cloud(9, key).into_iter().map(|to| (to, inverse(to))).collect();
            let found = fit(&pairs, Align::Similarity, &Alignment::IDENTITY);
            assert!(found.residual_max_mm < 1e-3, "{key}: {found:?}");
            assert!(
                (found.scale - motion.scale).abs() < 1e-4
                    && (found.angle_deg() - motion.angle_deg()).abs() < 1e-3
            );
            let rigid = fit(&pairs, Align::Rigid, &Alignment::IDENTITY);
            assert_eq!(rigid.scale, 1.0);
        }
    }

    #[test]
    fn what_points_leave_open_stays_as_it_was() {
        let turned = Alignment { rotation: DMat3::from_rotation_z(2.0), ..Alignment::IDENTITY };
        let line: Vec<(DVec3, DVec3)> =
            (0..5).map(|i| (DVec3::Z * f64::from(i), DVec3::Z * f64::from(i) + DVec3::X)).collect();
        for (pairs, near) in [(line, turned), (vec![(DVec3::X, DVec3::Y); 4], turned), (Vec::new(), turned)] {
            let found = fit(&pairs, Align::Rigid, &near);
            assert!((found.angle_deg() - near.angle_deg()).abs() < 1e-4, "{found:?}");
            assert!(pairs.is_empty() || found.residual_max_mm < 1e-9);
            assert!((found.rotation.determinant() - 1.0).abs() < 1e-12);
        }
    }
}
