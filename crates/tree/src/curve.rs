//! Polylines of samples: arc lengths, even spacing, calibres, straight fits.

use glam::DVec3;

use crate::graph::Sample;

/// The arc length at each sample from the first, in mm.
pub(crate) fn arc_lengths_mm(polyline: &[Sample]) -> Vec<f64> {
    let mut arc_mm = 0.0;
    let mut arcs = Vec::with_capacity(polyline.len());
    for (i, sample) in polyline.iter().enumerate() {
        if i > 0 {
            arc_mm += sample.position_mm.distance(polyline[i - 1].position_mm);
        }
        arcs.push(arc_mm);
    }
    arcs
}

/// The point between two samples at a share in [0, 1] of the way.
pub(crate) fn between(a: Sample, b: Sample, share: f64) -> Sample {
    Sample {
        position_mm: a.position_mm.lerp(b.position_mm, share),
        radius_mm: a.radius_mm + share * (b.radius_mm - a.radius_mm),
    }
}

/// The same curve with `n_edges` (at least 1) edges of equal arc length; both ends stay. The number of edges is
/// for the caller to bound; where the curve comes back on itself, samples may lie at one place.
pub(crate) fn evenly_spaced(polyline: &[Sample], n_edges: usize) -> Vec<Sample> {
    let arcs = arc_lengths_mm(polyline);
    let (Some(&first), Some(&last)) = (polyline.first(), polyline.last()) else { return Vec::new() };
    let total_mm = arcs[arcs.len() - 1];
    let mut even = Vec::with_capacity(n_edges + 1);
    even.push(first);
    let mut edge = 0;
    for i in 1..n_edges {
        let arc_mm = total_mm * i as f64 / n_edges as f64;
        while edge + 2 < arcs.len() && arcs[edge + 1] < arc_mm {
            edge += 1;
        }
        let length_mm = arcs[edge + 1] - arcs[edge];
        let share = if length_mm > 0.0 { ((arc_mm - arcs[edge]) / length_mm).clamp(0.0, 1.0) } else { 0.0 };
        even.push(between(polyline[edge], polyline[edge + 1], share));
    }
    even.push(last);
    even
}

/// A sphere reaches a tip if the tip is at most this multiple of its radius away: the cap, and a voxel beyond.
const REACH: f64 = 1.25;

/// The calibre of a tip, in mm: the radius of the largest sphere on its branch that reaches it. The tip's own sphere is
/// small wherever a skeleton ends near the surface.
pub(crate) fn calibre_mm(branch: &[Sample], tip: Sample) -> f64 {
    branch
        .iter()
        .filter(|s| s.position_mm.distance(tip.position_mm) <= REACH * s.radius_mm)
        .map(|s| s.radius_mm)
        .fold(tip.radius_mm, f64::max)
}

/// A straight line fitted to a stretch of a curve.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fit {
    /// A point on it, RAS+ mm: the centroid of the stretch.
    pub(crate) point_mm: DVec3,
    /// Its unit direction, along the stretch.
    pub(crate) direction: DVec3,
    /// Root mean square distance of the stretch from the line, in mm.
    pub(crate) rms_mm: f64,
    /// Mean radius of the stretch, in mm.
    pub(crate) radius_mm: f64,
    /// By how much the radius grows along the line, in mm per mm.
    pub(crate) taper: f64,
}

/// Least squares of the positions against the sample's number: for evenly spaced samples of a stretch that does not
/// turn back. `None` for fewer than three samples or a stretch that leads nowhere.
pub(crate) fn fit_line(stretch: &[Sample]) -> Option<Fit> {
    let n = stretch.len() as f64;
    if stretch.len() < 3 {
        return None;
    }
    let point_mm = stretch.iter().map(|s| s.position_mm).sum::<DVec3>() / n;
    let middle = 0.5 * (n - 1.0);
    let slope: DVec3 =
        stretch.iter().enumerate().map(|(i, s)| (s.position_mm - point_mm) * (i as f64 - middle)).sum();
    let direction = slope.try_normalize()?;
    let radius_mm = stretch.iter().map(|s| s.radius_mm).sum::<f64>() / n;
    let radius_slope: f64 =
        stretch.iter().enumerate().map(|(i, s)| (s.radius_mm - radius_mm) * (i as f64 - middle)).sum();
    let off_line = |s: &Sample| (s.position_mm - point_mm).reject_from_normalized(direction).length_squared();
    Some(Fit {
        point_mm,
        direction,
        rms_mm: (stretch.iter().map(off_line).sum::<f64>() / n).sqrt(),
        radius_mm,
        taper: radius_slope / slope.length(),
    })
}

/// The distance from one voxel to the next along a unit direction: the largest spacing projected on it, in mm.
pub(crate) fn voxel_along_mm(direction_voxel: DVec3, spacing_mm: DVec3) -> f64 {
    (direction_voxel.abs() * spacing_mm).max_element()
}
