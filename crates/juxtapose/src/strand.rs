//! A branch of both trees, place by place.
//!
//! **Input** its line in either tree, which of its ends are places that both trees know, the scale between them.
//! **Output** which place of one line is which of the other, and what changed.
//! **Notation** a an arc length of the baseline, b one of the follow-up; a = offset + slope · b.
//! **Steps** Between two forks that both trees have, places go by their share of the length. A tip is where a tube ends,
//! or where a scan stops seeing it, and so is a root with one branch: there arc lengths count from the fork, and what one
//! tree has beyond the other is its own. A difference below the radius there is none, for no more is known of where a
//! tube ends.
//! **Cost** O(points) for a mean, O(samples · points) for the narrowest place.

use espalier_geom::angle::between;
use espalier_geom::math;
use espalier_model::{Alignment, BranchChange, Fate, change_percent};
use glam::DVec3;

use crate::line::Line;

/// Shorter differences of length than this share are none, where no radius is known.
const LEAST_SHARE: f64 = 0.02;
/// Samples that the narrowest place is looked for at: two for each radius, within these bounds.
const SAMPLES: [f64; 2] = [1.0, 512.0];

/// Whether a line begins, and ends, at a place that both trees know.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Anchors {
    pub(crate) start: bool,
    pub(crate) end: bool,
}

/// A branch of both trees.
#[derive(Clone, Debug)]
pub(crate) struct Strand {
    pub(crate) baseline: Line,
    pub(crate) followup: Line,
    offset_mm: f64,
    slope: f64,
}

impl Strand {
    pub(crate) fn new([baseline, followup]: [Line; 2], anchors: Anchors, scale: f64) -> Self {
        let (length, other) = (baseline.length_mm(), scale * followup.length_mm());
        let radius_at_end = baseline.end_radius_mm().max(scale * followup.end_radius_mm());
        let radius_at_start = baseline.radii_mm[0].max(scale * followup.radii_mm[0]);
        let differs = |radius: f64| (length - other).abs() > radius.max(LEAST_SHARE * length);
        let (offset_mm, slope) = if !anchors.end && differs(radius_at_end) {
            (0.0, scale)
        } else if !anchors.start && anchors.end && differs(radius_at_start) {
            (length - other, scale)
        } else {
            (0.0, length / followup.length_mm())
        };
        Self { baseline, followup, offset_mm, slope }
    }

    /// The baseline's arc length at one of the follow-up; it may lie beyond the line.
    pub(crate) fn baseline_arc(&self, followup_mm: f64) -> f64 {
        self.offset_mm + self.slope * followup_mm
    }

    /// The follow-up's arc length at one of the baseline, on its line.
    pub(crate) fn followup_arc(&self, baseline_mm: f64) -> f64 {
        ((baseline_mm - self.offset_mm) / self.slope).clamp(0.0, self.followup.length_mm())
    }

    /// The arc lengths of the baseline between which both have a tube.
    pub(crate) fn covered(&self) -> [f64; 2] {
        let length = self.baseline.length_mm();
        let end = self.baseline_arc(self.followup.length_mm());
        // A share of the length that comes back as 0.999… of it is the whole.
        let end = if (end - length).abs() <= 1e-9 * length { length } else { end.min(length) };
        [self.offset_mm.clamp(0.0, end.max(0.0)), end]
    }

    /// The follow-up's radius at an arc length of the baseline, if it has a tube there.
    pub(crate) fn followup_radius(&self, baseline_mm: f64, slack_mm: f64) -> Option<f64> {
        let [from, to] = self.covered();
        let is_inside = baseline_mm >= from - slack_mm && baseline_mm <= to + slack_mm;
        is_inside.then(|| self.followup.radius_mm(self.followup_arc(baseline_mm)))
    }

    /// What changed; branches, generation and angles are for the caller to fill in.
    pub(crate) fn change(&self, alignment: &Alignment) -> BranchChange {
        let covered = self.covered();
        let across = covered.map(|arc| self.followup_arc(arc));
        let (narrowest_percent, narrowest_at_mm) = self.narrowest();
        let chord = |line: &Line, [from, to]: [f64; 2]| line.point_mm(to) - line.point_mm(from);
        let heading_change_deg =
            between_deg(chord(&self.baseline, covered), alignment.turn(chord(&self.followup, across)));
        BranchChange {
            fate: Fate::Matched,
            baseline_branches: Vec::new(),
            followup_branches: Vec::new(),
            generation: 0,
            length_mm: [self.baseline.length_mm(), self.followup.length_mm()],
            compared_mm: covered[1] - covered[0],
            radius_mm: [self.baseline.mean_radius_mm(covered), self.followup.mean_radius_mm(across)],
            narrowest_percent,
            narrowest_at_mm,
            angle_deg: [f64::NAN; 2],
            heading_change_deg,
            end_offset_mm: self.baseline.end_mm().distance(alignment.apply(self.followup.end_mm())),
        }
    }

    /// The largest loss of radius in percent, over a stretch as long as the baseline is wide, and the middle of it.
    fn narrowest(&self) -> (f64, f64) {
        let [from, to] = self.covered();
        let mean = self.baseline.mean_radius_mm([from, to]);
        if mean <= 0.0 || to <= from {
            return (f64::NAN, f64::NAN);
        }
        let stretch = (2.0 * mean).min(to - from);
        let n_steps = math::ceil((to - from - stretch) / (0.5 * mean)).clamp(SAMPLES[0], SAMPLES[1]) as usize;
        let mut worst = (f64::INFINITY, from);
        for step in 0..=n_steps {
            let low = from + (to - from - stretch) * step as f64 / n_steps as f64;
            let here = [low, low + stretch];
            let there = here.map(|arc| self.followup_arc(arc));
            let radii = [self.baseline.mean_radius_mm(here), self.followup.mean_radius_mm(there)];
            let change = change_percent(radii);
            if change < worst.0 {
                worst = (change, low + 0.5 * stretch);
            }
        }
        if worst.0.is_finite() { worst } else { (f64::NAN, f64::NAN) }
    }
}

/// The angle between two directions in degrees; `NaN` where one has none.
pub(crate) fn between_deg(a: DVec3, b: DVec3) -> f64 {
    if a == DVec3::ZERO || b == DVec3::ZERO { f64::NAN } else { between(a, b).to_degrees() }
}
