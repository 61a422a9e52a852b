//! Free ends are set where the organ ends.
//!
//! A curve skeleton ends somewhere between the last inscribed sphere and the surface, often bent towards a corner.
//!
//! **Input** [`Outline`] with evenly spaced lines. **Output** the same, its free ends (tips and the root) moved along
//! their tangents; a ledger entry for each that became longer.
//! **Steps** 1. The end sphere is the outermost one that has nearly the calibre of the tip; what lies beyond it
//! follows the surface and is dropped. 2. Fit a straight line to the stretch inside of it: the tangent, on which
//! the end is set. 3. See how far the mask goes on along the tangent, at most to twice the radius of the end sphere.
//! 4. `sphere`: the end is one radius before that; `surface`: there, at most one radius beyond the end sphere; at the
//! border of the scan both are the border.
//! **Which end is true?** A tube cut across and one with a round end have the same last sphere, one radius before the
//! end of the mask, and the round cones by which a tree stands for its organ add that radius again.
//! **Left alone** stubs of opened loops: they are no ends of the organ.
//! **Cost** O(N + steps along the tangents).

use std::f64::consts::TAU;

use espalier_geom::math::unit_vector;
use espalier_geom::space::plane_axes;
use espalier_model::{Ledger, LedgerEntry, LedgerKind, Mask};
use glam::DVec3;

use crate::curve::{arc_lengths_mm, calibre_mm, fit_line};
use crate::graph::Sample;
use crate::mask_walk::{free_length_mm, leaves_scan};
use crate::outline::Outline;
use crate::params::Tips;

/// The end sphere has at least this share of the calibre of the tip.
const NEARLY: f64 = 0.9;
/// The length of the stretch that gives the tangent, in calibres.
const STRETCH: f64 = 2.0;
/// At most this share of a line is dropped as following the surface, or by setting its end back.
const MAX_DROPPED: f64 = 0.5;
/// Rays beside the axis: their distances from it, in radii of the end sphere, and how many at each.
const RINGS: [f64; 2] = [0.3, 0.6];
const SPOKES: usize = 8;
/// The range of caps: on voxels a half sphere measures 0.5 to 0.7.
const CAP: [f64; 2] = [0.4, 0.8];
/// The rays beside the axis correct the one on it by at most this many radii.
const MAX_CORRECTION: f64 = 0.5;
/// So far inside the end sphere, in calibres, spheres may still be cut short by the end.
const END_ZONE: f64 = 0.25;
/// How far the mask is followed beyond the end sphere's centre, in its radii.
const LOOK_AHEAD: f64 = 2.0;

/// A line with its tip moved.
struct Moved {
    /// From the tip inwards.
    samples: Vec<Sample>,
    /// By how much the tip is further out than it was; negative if it was set back.
    outwards_mm: f64,
}

/// Sets all free ends.
pub(crate) fn set(outline: &mut Outline, mask: &Mask, tips: Tips, ledger: &mut Ledger) {
    let incident = outline.incidence();
    for (hub, lines) in incident.iter().enumerate() {
        let &[line_idx] = lines.as_slice() else { continue };
        if tips == Tips::Keep || outline.hubs[hub].is_stub {
            continue;
        }
        // Count the samples from the tip inwards, whichever way the line runs.
        let is_root = hub == outline.lines[line_idx].from;
        let mut inwards = outline.lines[line_idx].samples.clone();
        if !is_root {
            inwards.reverse();
        }
        let Some(Moved { mut samples, outwards_mm }) = moved(&inwards, mask, tips) else { continue };
        let tip = samples[0];
        outline.hubs[hub].sample = tip;
        if outwards_mm > 0.0 {
            ledger.0.push(LedgerEntry {
                kind: LedgerKind::TipExtended,
                position_mm: tip.position_mm,
                radius_mm: tip.radius_mm,
                length_mm: outwards_mm,
                reason: format!(
                    "thinning ended {outwards_mm:.3} mm before the end of a branch of radius {:.3} mm",
                    tip.radius_mm
                ),
            });
        }
        if !is_root {
            samples.reverse();
        }
        outline.lines[line_idx].samples = samples;
    }
}

/// A line, given from its tip inwards, with its tip where it belongs. `None` if the line is too short to have a
/// tangent, or its tangent runs outside of the mask.
fn moved(inwards: &[Sample], mask: &Mask, tips: Tips) -> Option<Moved> {
    let arcs = arc_lengths_mm(inwards);
    let droppable_mm = MAX_DROPPED * arcs.last()?;
    let tip = inwards[0];
    let calibre_mm = calibre_mm(inwards, tip);
    let end = inwards.iter().position(|s| s.radius_mm >= NEARLY * calibre_mm)?;
    let end = if arcs[end] <= droppable_mm { end } else { 0 };

    let inner = arcs.iter().rposition(|&arc| arc <= arcs[end] + STRETCH * calibre_mm)?;
    let fit = fit_line(&inwards[end..=inner])?;
    let outwards = -fit.direction;
    let on_axis = fit.point_mm + (inwards[end].position_mm - fit.point_mm).project_onto_normalized(outwards);
    let radius_mm = radius_at(&inwards[end..=inner], &arcs[end..=inner], on_axis, calibre_mm);

    let on_axis_mm = free_length_mm(mask, on_axis, outwards, LOOK_AHEAD * radius_mm)?;
    let free_mm = free_end_mm(mask, (on_axis, on_axis_mm), outwards, radius_mm);
    let beyond_mm = match tips {
        _ if leaves_scan(mask, on_axis, outwards, on_axis_mm) => on_axis_mm,
        Tips::Sphere => free_mm - radius_mm,
        Tips::Surface => free_mm.min(radius_mm),
        Tips::Keep => 0.0,
    };
    let beyond_mm = beyond_mm.max(arcs[end] - droppable_mm);

    let new_tip = Sample { position_mm: on_axis + outwards * beyond_mm, radius_mm };
    let mut samples = vec![new_tip];
    let stays = |s: &&Sample| (s.position_mm - new_tip.position_mm).dot(outwards) < 0.0;
    let first_kept = end + 1 + inwards[end + 1..].iter().position(|s| stays(&s)).unwrap_or(0);
    samples.extend_from_slice(&inwards[first_kept.min(inwards.len() - 1)..]);
    let outwards_mm = (new_tip.position_mm - tip.position_mm).dot(outwards);
    Some(Moved { samples, outwards_mm })
}

/// How far the mask goes on from a point along its axis, in mm, given how far it does on the axis itself.
///
/// That one ray alone is wrong by up to a voxel. So there are rays beside it, and their ends are fitted by
/// h = h₀ − c R x, x = (ρ/R)² for the distance ρ from the axis: c is 0 for a flat end and near ½ for a round one.
/// Thick slices cannot tell which, so c stays in `CAP`.
fn free_end_mm(mask: &Mask, (on_axis, on_axis_mm): (DVec3, f64), outwards: DVec3, radius_mm: f64) -> f64 {
    let limit_mm = LOOK_AHEAD * radius_mm;
    let (right, up) = plane_axes(outwards, DVec3::Z);
    let mut ends = vec![(0.0, on_axis_mm)];
    for share in RINGS {
        for spoke in 0..SPOKES {
            let around = unit_vector(TAU * (spoke as f64 + share) / SPOKES as f64);
            let aside = (right * around.x + up * around.y) * share * radius_mm;
            if let Some(end_mm) = free_length_mm(mask, on_axis + aside, outwards, limit_mm) {
                ends.push((share * share, end_mm));
            }
        }
    }
    let n = ends.len() as f64;
    let (mean_x, mean_y) =
        (ends.iter().map(|e| e.0).sum::<f64>() / n, ends.iter().map(|e| e.1).sum::<f64>() / n);
    let variance: f64 = ends.iter().map(|e| (e.0 - mean_x) * (e.0 - mean_x)).sum();
    let covariance: f64 = ends.iter().map(|e| (e.0 - mean_x) * (e.1 - mean_y)).sum();
    let is_whole = ends.len() == 1 + RINGS.len() * SPOKES;
    let slope_mm = -covariance / variance.max(f64::MIN_POSITIVE);
    let fitted_mm = mean_y + mean_x * slope_mm.clamp(CAP[0] * radius_mm, CAP[1] * radius_mm);
    // Where the tip is narrower than its end sphere, or bent, the axis alone has to do.
    let is_near = (fitted_mm - on_axis_mm).abs() <= MAX_CORRECTION * radius_mm;
    if is_whole && is_near { fitted_mm } else { on_axis_mm }
}

/// The radius of the tube at its end, in mm, from the stretch inside of it: the spheres at the very end are smaller.
fn radius_at(stretch: &[Sample], arcs: &[f64], end: DVec3, calibre_mm: f64) -> f64 {
    let first = arcs.iter().position(|&arc| arc >= arcs[0] + END_ZONE * calibre_mm).unwrap_or(0);
    let Some(fit) = fit_line(&stretch[first..]) else { return stretch[0].radius_mm };
    let extrapolated = fit.radius_mm + fit.taper * (end - fit.point_mm).dot(fit.direction);
    extrapolated.clamp(NEARLY * calibre_mm, calibre_mm)
}
