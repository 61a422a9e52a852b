//! Forks move to where the branches' axes meet.
//!
//! Near a fork the tubes have merged, and the curve skeleton runs in the middle of what they have become: it leaves the
//! axes and forks late, by up to several radii where branches part at a small angle. Lengths and branch angles
//! are wrong by that.
//!
//! **Input** [`Outline`] with evenly spaced lines. **Output** the same; forks moved, their radii those of the tubes,
//! lines led straight from the fork to where they are on their own axes.
//! **Steps** 1. For each line at a fork fit a straight line to the stretch that begins outside of the fork's sphere.
//! 2. The fork is the point nearest to all of them, each weighted by the inverse of its variance; the skeleton's own
//! fork counts as one measurement with a standard deviation of its radius, so that axes that meet badly change little.
//! 3. The move is bounded by `MAX_MOVE` radii, by half of each line's length, and by the mask.
//! 4. Samples between the fork and the fitted stretch give way to the straight connection.
//! **Guarantees** a fork does not leave the mask by this step; lines keep their ends and order.
//! **Source** own; the idea that a bifurcation is best located from outside of it is common in vessel analysis.
//! **Cost** O(N).

use espalier_model::Mask;
use glam::{DMat3, DVec3};

use crate::curve::{Fit, arc_lengths_mm, fit_line};
use crate::graph::{Hub, Sample};
use crate::mask_walk::is_inside;
use crate::outline::Outline;

/// The length of the fitted stretch, in radii of the branch.
const STRETCH: f64 = 3.0;
/// A shorter stretch than this, in radii of the branch, tells no direction.
const MIN_STRETCH: f64 = 1.0;
/// How far a fork may move, in radii of its own sphere.
const MAX_MOVE: f64 = 2.0;
/// What the position of a line is known to at best, in spacings of the grid: the scatter of sphere centres.
const SCATTER: f64 = 0.2;

/// A line as seen from a fork.
struct Arm {
    line: usize,
    is_outgoing: bool,
    length_mm: f64,
    /// The fitted stretch as (first sample, fit), counted from the fork.
    fit: Option<(usize, Fit)>,
}

/// Moves all forks of three or more lines; returns the mean distance moved in mm.
pub(crate) fn relocate(outline: &mut Outline, mask: &Mask) -> f64 {
    let incident = outline.incidence();
    let scatter_mm = SCATTER * mask.grid().spacing_mm().min_element();
    let forks: Vec<usize> = (0..outline.hubs.len()).filter(|&hub| incident[hub].len() > 2).collect();
    let arms: Vec<Vec<Arm>> = forks
        .iter()
        .map(|&hub| incident[hub].iter().map(|&line| arm(outline, hub, line)).collect())
        .collect();
    let moved: Vec<Sample> = forks
        .iter()
        .zip(&arms)
        .map(|(&hub, arms)| meeting_point(outline.hubs[hub].sample, arms, scatter_mm, mask))
        .collect();

    let mut total_mm = 0.0;
    for ((&hub, arms), &target) in forks.iter().zip(&arms).zip(&moved) {
        let before = outline.hubs[hub].sample;
        total_mm += before.position_mm.distance(target.position_mm);
        outline.hubs[hub] = Hub { sample: target, ..outline.hubs[hub] };
        for arm in arms {
            lead_to(outline, arm, before, target);
        }
    }
    if forks.is_empty() { 0.0 } else { total_mm / forks.len() as f64 }
}

/// The samples of a line counted from one of its hubs.
fn seen_from(samples: &[Sample], is_outgoing: bool) -> Vec<Sample> {
    if is_outgoing { samples.to_vec() } else { samples.iter().rev().copied().collect() }
}

fn arm(outline: &Outline, hub: usize, line_idx: usize) -> Arm {
    let line = &outline.lines[line_idx];
    let is_outgoing = line.from == hub;
    let samples = seen_from(&line.samples, is_outgoing);
    let arcs = arc_lengths_mm(&samples);
    let length_mm = arcs[arcs.len() - 1];
    let fork = outline.hubs[hub].sample;
    let far_radius_mm = outline.hubs[if is_outgoing { line.to } else { line.from }].sample.radius_mm;

    let outside = |s: &Sample| s.position_mm.distance(fork.position_mm) >= fork.radius_mm;
    let fit = samples.iter().position(outside).and_then(|first| {
        let radius_mm = samples[first].radius_mm;
        // The far end has a sphere of its own, inside of which the line is no better than here.
        let last_mm = (arcs[first] + STRETCH * radius_mm).min(length_mm - far_radius_mm);
        let last = arcs.iter().rposition(|&arc| arc <= last_mm)?;
        let is_long = last > first && arcs[last] - arcs[first] >= MIN_STRETCH * radius_mm;
        if is_long { fit_line(&samples[first..=last]).map(|fit| (first, fit)) } else { None }
    });
    Arm { line: line_idx, is_outgoing, length_mm, fit }
}

/// Where the arms meet, with the radius of the thickest of them.
fn meeting_point(fork: Sample, arms: &[Arm], scatter_mm: f64, mask: &Mask) -> Sample {
    let fits: Vec<&Fit> = arms.iter().filter_map(|arm| arm.fit.as_ref().map(|(_, fit)| fit)).collect();
    if fits.len() < 2 || fork.radius_mm <= 0.0 {
        return fork;
    }
    // Least squares: Σ wᵢ |(I − dᵢdᵢᵀ)(x − pᵢ)|² + |x − fork|² / r².
    let prior = 1.0 / (fork.radius_mm * fork.radius_mm);
    let mut normal = DMat3::from_diagonal(DVec3::splat(prior));
    let mut right = fork.position_mm * prior;
    for fit in &fits {
        let weight = 1.0 / (fit.rms_mm * fit.rms_mm + scatter_mm * scatter_mm);
        let d = fit.direction;
        let off_line = DMat3::IDENTITY - DMat3::from_cols(d * d.x, d * d.y, d * d.z);
        normal += off_line * weight;
        right += off_line * fit.point_mm * weight;
    }
    let mut shift = normal.inverse() * right - fork.position_mm;

    let half_arm_mm = arms.iter().map(|arm| 0.5 * arm.length_mm).fold(f64::INFINITY, f64::min);
    shift = shift.clamp_length_max(half_arm_mm.min(MAX_MOVE * fork.radius_mm));
    while !is_inside(mask, fork.position_mm + shift) {
        shift *= 0.5;
        if shift.length() < scatter_mm {
            return fork;
        }
    }
    let thickest_mm = fits.iter().map(|fit| fit.radius_mm).fold(0.0, f64::max);
    Sample { position_mm: fork.position_mm + shift, radius_mm: thickest_mm.min(fork.radius_mm) }
}

/// Leads a line to the new place of its fork.
fn lead_to(outline: &mut Outline, arm: &Arm, before: Sample, target: Sample) {
    let line = &mut outline.lines[arm.line];
    let mut samples = seen_from(&line.samples, arm.is_outgoing);
    match &arm.fit {
        Some((first, _)) => {
            samples.drain(..*first);
            samples.insert(0, target);
        }
        None => {
            // Too short to know its axis: the move fades out over the line.
            let shift = target.position_mm - before.position_mm;
            let arcs = arc_lengths_mm(&samples);
            let total_mm = arcs[arcs.len() - 1].max(f64::MIN_POSITIVE);
            for (sample, arc_mm) in samples.iter_mut().zip(arcs) {
                sample.position_mm += shift * (1.0 - arc_mm / total_mm);
            }
            samples[0] = target;
        }
    }
    line.samples = seen_from(&samples, arm.is_outgoing);
}
