//! Forks move to where the branches' axes meet.
//!
//! Near a fork the tubes have merged, and the curve skeleton runs in the middle of what they have become: it leaves the
//! axes and forks late, by up to several radii where branches part at a small angle. Lengths and branch angles
//! are wrong by that.
//!
//! **Input** [`Outline`] with evenly spaced lines. **Output** the same; forks moved, their radii those of the tubes,
//! lines led straight from the fork to where they are on their own axes.
//! **Steps** 1. For each line at a fork fit a straight line to the stretch that begins outside of the fork's sphere
//! and, if it is long enough for that, where its own spheres are clear of those of the fork's other lines.
//! 2. The fork is the point nearest to all of them, each weighted by the inverse of its variance; the skeleton's own
//! fork counts as one measurement with a standard deviation of its radius, so that axes that meet badly change little.
//! 3. The axes of two daughters in a wide parent meet far up in it, where it still is one vessel: as long as the
//! tubes of all daughters run inside of the parent's, the fork follows them up for no more than the parent's radius.
//! 4. The move is bounded by `MAX_MOVE` radii, by a share of each line's length, and by the mask.
//! 5. Samples between the fork and the fitted stretch, and those that do not lie ahead of the fork's new sphere, give way
//! to the straight connection.
//! 6. After smoothing, [`clear_spheres`] takes away what a line does inside of the sphere of a fork at its ends: the
//! first sample that counts is the first beyond, so no short edge at a fork bears a turn that is a voxel's.
//! **Guarantees** a fork does not leave the mask by this step; lines keep their ends and order.
//! **Source** own; the idea that a bifurcation is best located from outside of it is common in vessel analysis.
//! **Cost** O(N + Σ n²) for N samples, the sum over the forks and n the samples of all lines at a fork within
//! `MERGED_REACH` radii of it: each is held against those of the other lines. In voxels, n is about ten radii a line.

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
/// Two spheres are clear of each other if their centres are this share of the sum of their radii apart: where two equal
/// tubes part at an angle β, both are on their axes from cos(β/2) on.
const CLEAR: f64 = 0.95;
/// Where tubes merge at most, in radii of the fork's sphere: beyond, branches are neighbours, not one body.
const MERGED_REACH: f64 = 5.0;
/// How far a fork may move, in radii of its own sphere.
const MAX_MOVE: f64 = 2.0;
/// How far a fork may move, as a share of each line at it: two forks that move towards each other stay apart.
const MAX_SHARE: f64 = 0.4;
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

/// What becomes of one end of a line.
struct LineEnd {
    /// The fork's new place.
    target: Sample,
    /// By how much the fork moved.
    shift: DVec3,
    /// The samples that give way to the straight connection; `None` if the line's axis is not known.
    merged: Option<Merged>,
}

/// What gives way at one end of a line.
#[derive(Clone, Copy)]
struct Merged {
    /// How many samples at least.
    n_samples: usize,
    /// The direction of the line's axis away from the fork: the samples that are not a radius ahead give way, too.
    ahead: DVec3,
}

/// Moves all forks of three or more lines; returns the mean distance moved in mm.
pub(crate) fn relocate(outline: &mut Outline, mask: &Mask) -> f64 {
    let incident = outline.incidence();
    let scatter_mm = SCATTER * mask.grid().spacing_mm().min_element();
    let forks: Vec<usize> = (0..outline.hubs.len()).filter(|&hub| incident[hub].len() > 2).collect();
    let arms: Vec<Vec<Arm>> = forks.iter().map(|&hub| arms_of(outline, hub, &incident[hub])).collect();
    let moved: Vec<Sample> = forks
        .iter()
        .zip(&arms)
        .map(|(&hub, arms)| meeting_point(outline.hubs[hub].sample, arms, scatter_mm, mask))
        .collect();

    let mut ends: Vec<[Option<LineEnd>; 2]> = outline.lines.iter().map(|_| [None, None]).collect();
    let mut total_mm = 0.0;
    for ((&hub, arms), &target) in forks.iter().zip(&arms).zip(&moved) {
        let shift = target.position_mm - outline.hubs[hub].sample.position_mm;
        if shift == DVec3::ZERO {
            continue;
        }
        total_mm += shift.length();
        outline.hubs[hub] = Hub { sample: target, ..outline.hubs[hub] };
        for arm in arms {
            let merged =
                arm.fit.as_ref().map(|&(first, fit)| Merged { n_samples: first, ahead: fit.direction });
            ends[arm.line][usize::from(!arm.is_outgoing)] = Some(LineEnd { target, shift, merged });
        }
    }
    for (line, ends) in outline.lines.iter_mut().zip(&ends) {
        line.samples = led_to(&line.samples, ends);
    }
    if forks.is_empty() { 0.0 } else { total_mm / forks.len() as f64 }
}

/// The samples of a line counted from one of its hubs.
fn seen_from(samples: &[Sample], is_outgoing: bool) -> Vec<Sample> {
    if is_outgoing { samples.to_vec() } else { samples.iter().rev().copied().collect() }
}

fn arms_of(outline: &Outline, hub: usize, lines: &[usize]) -> Vec<Arm> {
    let fork = outline.hubs[hub].sample;
    let is_outgoing: Vec<bool> = lines.iter().map(|&line| outline.lines[line].from == hub).collect();
    let seen: Vec<Vec<Sample>> = lines
        .iter()
        .zip(&is_outgoing)
        .map(|(&line, &is_outgoing)| seen_from(&outline.lines[line].samples, is_outgoing))
        .collect();
    (0..lines.len())
        .map(|i| {
            let line = &outline.lines[lines[i]];
            let far_hub = if is_outgoing[i] { line.to } else { line.from };
            let others = seen.iter().enumerate().filter(|&(j, _)| j != i).map(|(_, other)| near(other, fork));
            let clear = first_clear(near(&seen[i], fork), &others.collect::<Vec<_>>());
            let arcs = arc_lengths_mm(&seen[i]);
            Arm {
                line: lines[i],
                is_outgoing: is_outgoing[i],
                length_mm: arcs[arcs.len() - 1],
                fit: fit_arm(&seen[i], &arcs, clear, (fork, outline.hubs[far_hub].sample.radius_mm)),
            }
        })
        .collect()
}

/// The samples of a line before it is farther from its fork than merged tubes reach.
fn near(samples: &[Sample], fork: Sample) -> &[Sample] {
    let is_far = |s: &Sample| s.position_mm.distance(fork.position_mm) > MERGED_REACH * fork.radius_mm;
    &samples[..samples.iter().position(is_far).unwrap_or(samples.len())]
}

/// The first sample from which on the spheres of a line are clear of those of the other lines.
fn first_clear(samples: &[Sample], others: &[&[Sample]]) -> usize {
    let touches =
        |s: &Sample, t: &Sample| s.position_mm.distance(t.position_mm) < CLEAR * (s.radius_mm + t.radius_mm);
    let is_clear = |s: &Sample| others.iter().all(|other| other.iter().all(|t| !touches(s, t)));
    samples.iter().rposition(|s| !is_clear(s)).map_or(0, |last| last + 1)
}

/// The straight line of an arm, and the sample from which on it holds.
fn fit_arm(
    samples: &[Sample],
    arcs: &[f64],
    clear: usize,
    (fork, far_radius_mm): (Sample, f64),
) -> Option<(usize, Fit)> {
    let outside = |s: &Sample| s.position_mm.distance(fork.position_mm) >= fork.radius_mm;
    let nearest = samples.iter().position(outside)?;
    // The far end has a sphere of its own, inside of which the line is no better than here.
    let end_mm = arcs[arcs.len() - 1] - far_radius_mm;
    [nearest.max(clear), nearest].into_iter().filter(|&first| first < samples.len()).find_map(|first| {
        let radius_mm = samples[first].radius_mm;
        let last_mm = (arcs[first] + STRETCH * radius_mm).min(end_mm);
        let last = arcs.iter().rposition(|&arc| arc <= last_mm)?;
        let is_long = last > first && arcs[last] - arcs[first] >= MIN_STRETCH * radius_mm;
        if is_long { fit_line(&samples[first..=last]).map(|fit| (first, fit)) } else { None }
    })
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

    let parent_mm = fits.iter().map(|fit| fit.radius_mm).fold(0.0, f64::max);
    if fits.len() == arms.len() {
        let up_to_mm = (shift.length() - shared_mm(&fits)).max(parent_mm);
        shift = shift.clamp_length_max(up_to_mm);
    }
    let shortest_mm = arms.iter().map(|arm| arm.length_mm).fold(f64::INFINITY, f64::min);
    let limit_mm = (MAX_SHARE * shortest_mm).min(MAX_MOVE * fork.radius_mm);
    shift = shift.clamp_length_max(limit_mm);
    while !is_inside(mask, fork.position_mm + shift) {
        shift *= 0.5;
        // Also left by a shift that is no number.
        if shift.length().max(0.0) < scatter_mm {
            return fork;
        }
    }
    Sample { position_mm: fork.position_mm + shift, radius_mm: parent_mm }
}

/// For how long, in mm along the axis of the thickest arm from where the axes meet, the tubes of all other arms run
/// inside of its own. It is 0 where one of them is as thick or leads aside.
fn shared_mm(fits: &[&Fit]) -> f64 {
    let thicker = |a: usize, b: usize| if fits[b].radius_mm > fits[a].radius_mm { b } else { a };
    let parent = (0..fits.len()).fold(0, thicker);
    let inside_mm = |fit: &Fit| {
        let cos = fit.direction.dot(-fits[parent].direction);
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        (fits[parent].radius_mm - fit.radius_mm) * cos.max(0.0) / sin.max(f64::EPSILON)
    };
    (0..fits.len()).filter(|&i| i != parent).map(|i| inside_mm(fits[i])).fold(f64::INFINITY, f64::min)
}

/// Takes away the samples of each line inside of the spheres of the forks at its ends.
pub(crate) fn clear_spheres(outline: &mut Outline) {
    let n_lines: Vec<usize> = outline.incidence().iter().map(Vec::len).collect();
    for line in &mut outline.lines {
        let last = line.samples.len() - 1;
        let n_inside = |hub: usize, inwards: &mut dyn Iterator<Item = &Sample>| {
            let fork = outline.hubs[hub].sample;
            let is_inside = |s: &&Sample| s.position_mm.distance(fork.position_mm) < fork.radius_mm;
            if n_lines[hub] > 2 { inwards.take_while(is_inside).count().max(1) } else { 1 }
        };
        let first = n_inside(line.from, &mut line.samples.iter());
        let beyond = (last + 1).saturating_sub(n_inside(line.to, &mut line.samples.iter().rev()));
        let mut kept = vec![line.samples[0]];
        kept.extend_from_slice(line.samples.get(first..beyond).unwrap_or_default());
        kept.push(line.samples[last]);
        line.samples = kept;
    }
}

/// A line led to the new places of the forks at its ends.
fn led_to(samples: &[Sample], [start, end]: &[Option<LineEnd>; 2]) -> Vec<Sample> {
    let arcs = arc_lengths_mm(samples);
    let total_mm = arcs[arcs.len() - 1].max(f64::MIN_POSITIVE);
    let mut led = samples.to_vec();

    // Where a line is too short to know its axis, the move of its end fades out over it.
    for (sample, arc_mm) in led.iter_mut().zip(arcs) {
        let share = arc_mm / total_mm;
        for (end, weight) in [(start, 1.0 - share), (end, share)] {
            if let Some(LineEnd { shift, merged: None, .. }) = end {
                sample.position_mm += *shift * weight;
            }
        }
    }

    // Where it is known, what lies before it gives way; if both ends claim the same samples, all between them does.
    let first = n_merged(start, &mut led.iter());
    let last = led.len().saturating_sub(n_merged(end, &mut led.iter().rev())).max(first);
    let end_sample = |end: &Option<LineEnd>, sample: Sample| end.as_ref().map_or(sample, |end| end.target);
    let mut line = vec![end_sample(start, led[0])];
    line.extend_from_slice(led.get(first..last).unwrap_or_default());
    line.push(end_sample(end, led[led.len() - 1]));
    line
}

/// How many samples give way at an end of a line, the end itself among them; the samples are counted from there.
fn n_merged(end: &Option<LineEnd>, samples: &mut dyn Iterator<Item = &Sample>) -> usize {
    let Some(LineEnd { target, merged: Some(merged), .. }) = end else { return 1 };
    let is_ahead = |s: &Sample| (s.position_mm - target.position_mm).dot(merged.ahead) >= target.radius_mm;
    let n_behind = samples.enumerate().find(|&(i, s)| i >= merged.n_samples && is_ahead(s)).map(|(i, _)| i);
    n_behind.unwrap_or(merged.n_samples).max(1)
}
