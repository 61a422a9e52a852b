//! The background around a point: the distance at any point between voxels.
//!
//! **Input** the field and a point p on its ridge. **Output** the background centres that can be nearest to a point
//! within [`REACH`] of p, hence the distance there, and its maximum across the branch.
//! **Steps** 1. In each row along x that is near enough, find the first background voxels to the left and to the
//! right; the field itself says how far the row may be skipped. 2. Keep those not farther than the nearest plus
//! twice the reach. 3. Maximise the least distance to them by a pattern search in the plane across the branch.
//! **Guarantees** the distance is exact within the reach.
//! **Cost** O((r/s)²) look-ups for radius r at spacing s; a few dozen times the kept centres.

use espalier_geom::space::plane_axes;
use glam::DVec3;

use crate::center::nearest_voxel;
use crate::distance::DistanceField;

/// How far from the point the distance is exact, in units of the largest spacing.
const REACH: f64 = 0.75;
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
    /// The boundary as seen from `point`.
    pub(crate) fn around(field: &DistanceField, point: DVec3) -> Self {
        let spacing = field.spacing_mm();
        let voxel = nearest_voxel(field, point);
        let reach = REACH * spacing.max_element();
        // |site − voxel| ≤ D(voxel) + 2·|q − voxel| for the site nearest to any q within reach.
        let radius = field.distance_mm(voxel) + 2.0 * (reach + point.distance(field.position_mm(voxel)));
        let mut boundary = Self { sites: Vec::new(), spacing };
        if radius.is_finite() {
            boundary.gather(field, voxel, radius);
            let farthest = boundary.distance_mm(point) + 2.0 * reach;
            boundary.sites.retain(|site| site.distance_squared(point) <= farthest * farthest);
        }
        boundary
    }

    /// Gathers the innermost background centres of the rows that come within `radius` of `voxel`.
    fn gather(&mut self, field: &DistanceField, voxel: [i64; 3], radius: f64) {
        let (spacing, center) = (field.spacing_mm(), field.position_mm(voxel));
        let [_, ny, nz] = (radius / spacing).to_array().map(|n| n as i64);
        for z in voxel[2] - nz..=voxel[2] + nz {
            for y in voxel[1] - ny..=voxel[1] + ny {
                let row = [voxel[0], y, z];
                let along_squared = radius * radius - field.position_mm(row).distance_squared(center);
                if along_squared >= 0.0 {
                    let n_steps = (along_squared.sqrt() / spacing.x) as i64;
                    let reach_steps = (REACH * spacing.max_element() / spacing.x) as i64 + 1;
                    visit_row(field, row, [n_steps, reach_steps], |site| {
                        self.sites.push(field.position_mm(site));
                    });
                }
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

/// Visits the background voxels of a row within `reach_steps`, and the first on each side beyond, not more than
/// `n_steps` away.
fn visit_row(
    field: &DistanceField,
    row: [i64; 3],
    [n_steps, reach_steps]: [i64; 2],
    mut visit: impl FnMut([i64; 3]),
) {
    for (sign, first) in [(-1, 0), (1, 1)] {
        let mut step = first;
        while step <= n_steps {
            let voxel = [row[0] + sign * step, row[1], row[2]];
            let distance = field.distance_mm(voxel);
            // A foreground voxel has no background within its distance, in its row neither.
            step += ((distance / field.spacing_mm().x) as i64).max(1);
            if distance == 0.0 {
                if field.is_background(voxel) {
                    visit(voxel);
                }
                if step > reach_steps {
                    break;
                }
            }
        }
    }
}
