//! How thick a branch is.
//!
//! **Input** [`Line`]: radii change linearly between its points. **Output** [`Calibre`]; every integral is exact for
//! such a line. **Cost** O(points).

use std::f64::consts::PI;

use super::line::Line;

/// Radii, volume and surface of a branch.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Calibre {
    pub(super) mean_mm: f64,
    pub(super) min_mm: f64,
    pub(super) max_mm: f64,
    /// Loss of radius per length.
    pub(super) taper: f64,
    pub(super) volume_mm3: f64,
    pub(super) surface_mm2: f64,
}

impl Calibre {
    pub(super) fn of(line: &Line) -> Self {
        let (mut weighted, mut volume_mm3, mut surface_mm2) = (0.0, 0.0, 0.0);
        for ([s0, s1], [r0, r1]) in line.edges() {
            let length = s1 - s0;
            weighted += length * 0.5 * (r0 + r1);
            volume_mm3 += PI / 3.0 * length * (r0 * r0 + r0 * r1 + r1 * r1);
            surface_mm2 += PI * (r0 + r1) * (length * length + (r1 - r0) * (r1 - r0)).sqrt();
        }
        let mean_mm = weighted / line.length_mm();
        let min_mm = line.radii_mm.iter().copied().fold(f64::INFINITY, f64::min);
        let max_mm = line.radii_mm.iter().copied().fold(0.0, f64::max);
        Self { mean_mm, min_mm, max_mm, taper: -slope(line, mean_mm), volume_mm3, surface_mm2 }
    }

    /// Its mean radius as a share of another's.
    pub(super) fn ratio_to(&self, other: &Self) -> f64 {
        if other.mean_mm > 0.0 { self.mean_mm / other.mean_mm } else { f64::NAN }
    }
}

/// The slope of the straight line that fits radius against arc length best, every mm counting alike:
/// ∫ (s − s̄) r ds / ∫ (s − s̄)² ds.
fn slope(line: &Line, mean_mm: f64) -> f64 {
    let length = line.length_mm();
    let middle = 0.5 * length;
    let mut covariance = 0.0;
    for ([s0, s1], [r0, r1]) in line.edges() {
        let ([a, b], [p, q]) = ([s0 - middle, s1 - middle], [r0 - mean_mm, r1 - mean_mm]);
        covariance += (s1 - s0) / 6.0 * (2.0 * (a * p + b * q) + a * q + b * p);
    }
    12.0 * covariance / (length * length * length)
}
