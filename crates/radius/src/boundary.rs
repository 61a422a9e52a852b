//! The background around a point: the distance at any point between voxels.
//!
//! **Input** a mask's background and a point p. **Output** the background centres that can be nearest to a point
//! within [`REACH`] of p, hence the distance there, and its maximum across the branch.
//! **Steps** 1. In each row along x that is near enough, the words tell the first background voxels to the left and to
//! the right, and all within the reach. 2. Keep those not farther than the nearest plus twice the reach. 3. Maximise the
//! least distance to them by a pattern search in the plane across the branch.
//! **Guarantees** the distance is exact within the reach.
//! **Cost** O((r/s)²) words for radius r at spacing s; a few dozen times the kept centres.

use espalier_geom::space::plane_axes;
use glam::DVec3;

use crate::nearest::{Background, zero_at_or_after, zero_at_or_before};

/// How far from the point the distance is exact, in units of the largest spacing.
pub(crate) const REACH: f64 = 0.75;
/// Step lengths of the pattern search, in units of the spacing across.
const STEPS: [f64; 4] = [0.4, 0.2, 0.1, 0.05];
/// Moves at one step length.
const MAX_MOVES: usize = 3;

/// The background centres about a point, in grid mm.
pub(crate) struct Boundary {
    sites: Vec<DVec3>,
    spacing: DVec3,
}

impl Boundary {
    /// The boundary as seen from `point`, whose own distance is `distance_mm`.
    pub(crate) fn around(background: Background<'_>, point: DVec3, distance_mm: f64) -> Self {
        let spacing = background.spacing_mm();
        let reach = REACH * spacing.max_element();
        let mut boundary = Self { sites: Vec::new(), spacing };
        // |site − p| ≤ D(p) + 2·|q − p| for the site nearest to any q within reach.
        let radius = distance_mm + 2.0 * reach;
        if radius.is_finite() {
            boundary.gather(background, point, radius);
        }
        boundary
    }

    /// Gathers the innermost background centres of the rows that come within `radius` of `point`.
    fn gather(&mut self, background: Background<'_>, point: DVec3, radius: f64) {
        let spacing = background.spacing_mm();
        let reach_steps = REACH * spacing.max_element() / spacing.x;
        let low = ((point - radius) / spacing).ceil().to_array().map(|c| c as i64);
        let high = ((point + radius) / spacing).floor().to_array().map(|c| c as i64);
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                let across = DVec3::new(0.0, y as f64, z as f64) * spacing - point.with_x(0.0);
                let along_squared = radius * radius - across.length_squared();
                let Some(words) = background.row(y, z).filter(|_| along_squared >= 0.0) else { continue };
                let steps = [reach_steps, along_squared.sqrt() / spacing.x];
                visit_row(words, background.n_columns(), point.x / spacing.x, steps, |x| {
                    self.sites.push(DVec3::new(x as f64, y as f64, z as f64) * spacing);
                });
            }
        }
    }

    /// The distance from a point to the nearest background centre, in mm; infinite if there is none near.
    pub(crate) fn distance_mm(&self, point: DVec3) -> f64 {
        self.sites.iter().map(|site| site.distance_squared(point)).fold(f64::INFINITY, f64::min).sqrt()
    }

    /// The point near `start`, across the branch and in the box from the first to the last voxel at `last_mm`, whose
    /// distance is largest, and that distance.
    pub(crate) fn highest_near(&self, start: DVec3, tangent: Option<DVec3>, last_mm: DVec3) -> (DVec3, f64) {
        let directions: Vec<DVec3> = match tangent {
            Some(tangent) => {
                let (right, up) = plane_axes(tangent, DVec3::Z);
                vec![right, up, -right, -up]
            }
            // Where branches meet, any way leads to the largest sphere.
            None => vec![DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z],
        };
        let reach = REACH * self.spacing.max_element();
        let mut best = (start, self.distance_mm(start));
        for step in STEPS {
            for _ in 0..MAX_MOVES {
                let before = best.1;
                for direction in &directions {
                    // The spacing that this direction sees.
                    let length = step * (*direction * self.spacing).length();
                    let point = best.0 + *direction * length;
                    let is_inside = point == point.clamp(DVec3::ZERO, last_mm);
                    if !is_inside || point.distance(start) > reach {
                        continue;
                    }
                    let distance = self.distance_mm(point);
                    if distance > best.1 {
                        best = (point, distance);
                    }
                }
                if best.1 <= before {
                    break;
                }
            }
        }
        best
    }
}

/// Visits the background voxels of a row of `n` within `reach` voxels of `center`, and the first on each side beyond, not
/// more than `limit` away.
fn visit_row(words: &[u64], n: usize, center: f64, [reach, limit]: [f64; 2], mut visit: impl FnMut(usize)) {
    let last = n - 1;
    let mut right = Some((center.ceil().max(0.0) as usize).min(last));
    while let Some(x) = right.and_then(|x| zero_at_or_after(words, x, n)) {
        if x as f64 - center > limit {
            break;
        }
        visit(x);
        right = (x as f64 - center <= reach && x < last).then_some(x + 1);
    }
    let first_left = center.ceil() - 1.0;
    let mut left = (first_left >= 0.0).then_some((first_left as usize).min(last));
    while let Some(x) = left.and_then(|x| zero_at_or_before(words, x)) {
        if center - x as f64 > limit {
            break;
        }
        visit(x);
        left = if center - x as f64 <= reach { x.checked_sub(1) } else { None };
    }
}
