//! Free ends go to the end of the mask.
//!
//! A curve skeleton ends somewhere between the last inscribed sphere and the surface, often bent towards a corner.
//!
//! **Input** [`Outline`] with evenly spaced lines. **Output** the same, with free ends (tips and the root) led straight
//! to the end of the mask; a ledger entry for each.
//! **Steps** 1. The end sphere is the outermost one that has nearly the calibre of the tip; what lies beyond it follows
//! the surface and is dropped. 2. Fit a straight line to the stretch inside of it: the tangent, on which the end
//! is set. 3. Go on along the tangent while inside the mask, by at most the radius of the end sphere.
//! **Which end?** The truth is where the axis leaves the organ: the flat end of a tube cut across, the apex of a rounded
//! one. Both lie one radius beyond the end sphere, so one rule serves both.
//! **Left alone** stubs of opened loops: they are no ends of the organ.
//! **Cost** O(N + steps along the tangents).

use espalier_model::{Ledger, LedgerEntry, LedgerKind, Mask};

use crate::curve::{arc_lengths_mm, fit_line};
use crate::graph::Sample;
use crate::mask_walk::free_length_mm;
use crate::outline::Outline;

/// A sphere reaches a tip if the tip is at most this multiple of its radius away.
const REACH: f64 = 1.25;
/// The end sphere has at least this share of the calibre of the tip.
const NEARLY: f64 = 0.9;
/// The length of the stretch that gives the tangent, in calibres.
const STRETCH: f64 = 2.0;
/// At most this share of a line is dropped as following the surface.
const MAX_DROPPED: f64 = 0.5;

/// Extends all free ends; returns how many.
pub(crate) fn extend(outline: &mut Outline, mask: &Mask, ledger: &mut Ledger) -> usize {
    let incident = outline.incidence();
    let mut n_extended = 0;
    for (hub, lines) in incident.iter().enumerate() {
        let &[line_idx] = lines.as_slice() else { continue };
        if outline.hubs[hub].is_stub {
            continue;
        }
        // Count the samples from the tip inwards, whichever way the line runs.
        let is_root = hub == outline.lines[line_idx].from;
        let mut samples = outline.lines[line_idx].samples.clone();
        if !is_root {
            samples.reverse();
        }
        let Some((extended, length_mm)) = extended(&samples, mask) else { continue };
        samples = extended;
        outline.hubs[hub].sample = samples[0];
        ledger.0.push(LedgerEntry {
            kind: LedgerKind::TipExtended,
            position_mm: samples[0].position_mm,
            radius_mm: samples[0].radius_mm,
            length_mm,
            reason: format!(
                "led {length_mm:.3} mm beyond its end sphere of radius {:.3} mm, to the end of the mask or by that radius",
                samples[0].radius_mm
            ),
        });
        if !is_root {
            samples.reverse();
        }
        outline.lines[line_idx].samples = samples;
        n_extended += 1;
    }
    n_extended
}

/// The samples of a line from its tip inwards, the tip led to the end of the mask, and by how much beyond the end
/// sphere. `None` if the line is too short to have a tangent.
fn extended(samples: &[Sample], mask: &Mask) -> Option<(Vec<Sample>, f64)> {
    let arcs = arc_lengths_mm(samples);
    let total_mm = *arcs.last()?;
    let tip = samples[0];
    let calibre_mm = samples
        .iter()
        .filter(|s| s.position_mm.distance(tip.position_mm) <= REACH * s.radius_mm)
        .map(|s| s.radius_mm)
        .fold(tip.radius_mm, f64::max);
    let end = samples.iter().position(|s| s.radius_mm >= NEARLY * calibre_mm)?;
    let end = if arcs[end] <= MAX_DROPPED * total_mm { end } else { 0 };

    let inner = arcs.iter().rposition(|&arc| arc <= arcs[end] + STRETCH * calibre_mm)?;
    let fit = fit_line(&samples[end..=inner])?;
    let on_axis =
        fit.point_mm + (samples[end].position_mm - fit.point_mm).project_onto_normalized(fit.direction);
    let length_mm = free_length_mm(mask, on_axis, -fit.direction, samples[end].radius_mm);
    let radius_mm = samples[end].radius_mm;
    let mut line = vec![Sample { position_mm: on_axis - fit.direction * length_mm, radius_mm }];
    if length_mm > 0.0 {
        line.push(Sample { position_mm: on_axis, radius_mm });
    }
    line.extend_from_slice(&samples[end + 1..]);
    Some((line, length_mm))
}
