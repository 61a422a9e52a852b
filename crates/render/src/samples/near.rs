//! A cone at a sample that it comes near to, and how it stands to the highest one.

use super::surface::{Best, Part, Surface, bend, color};
use super::tube::Tube;
use super::{GAP_PX, SEAM_PX};
use crate::cone::Hit;
use crate::raster::{Drawn, Job};

/// Two cones join if the path between them is at most this many of their radii; beyond, the fillets get smaller, and
/// from [`APART`] on they are distant parts.
const JOINED: f32 = 4.0;
const APART: f32 = 10.0;
/// How far a cone's colour reaches into another's, as a share of the square of its radius.
const COLOR_REACH: f32 = 0.8;

/// How much two places belong together, by the path between them and the sum of their radii: 1 in one neighbourhood of
/// the tree, 0 in distant parts.
pub(super) fn kinship(path_px: f32, radii_px: f32) -> f32 {
    ((APART - path_px / radii_px) / (APART - JOINED)).clamp(0.0, 1.0)
}

/// The level of a place, measured from the axis of the highest cone: in space the axes may lie at different depths.
pub(super) fn level_from(best: &Hit, hit: &Hit) -> f32 {
    // Beyond the outline there is no surface whose depth would count.
    let behind = (hit.z - hit.height) - (best.z - best.height);
    let solid = (hit.height / hit.radius).min(1.0);
    hit.level + 2.0 * hit.height * behind + solid * behind * behind.abs()
}

/// A cone near a sample.
pub(super) struct Near<'a> {
    edge: &'a Drawn,
    hit: Hit,
    /// Its level, measured from the axis of the highest.
    pub level: f32,
    /// The sum of the radii.
    radii: f32,
    /// How much the two belong together.
    pub kin: f32,
    fringe_px: f32,
}

impl<'a> Near<'a> {
    pub(super) fn new(job: &Job<'a>, best: &Best, (index, hit): (u32, Hit), fringe_px: f32) -> Self {
        let (edge, winner) = (&job.drawn[index as usize], &job.drawn[best.index as usize]);
        let place = |edge: &Drawn, hit: &Hit| {
            (edge.node, edge.arc_px[0] + hit.share * (edge.arc_px[1] - edge.arc_px[0]))
        };
        let radii = hit.radius + best.hit.radius;
        let path = job.kinship.path_px(place(edge, &hit), place(winner, &best.hit), APART * radii);
        let level = level_from(&best.hit, &hit);
        Self { edge, hit, level, radii, kin: kinship(path, radii), fringe_px }
    }

    /// How much of its normal and colour reaches the sample.
    fn weight(&self, best: &Best) -> f32 {
        let reach = COLOR_REACH * self.hit.radius * self.hit.radius;
        let fade = (1.0 - (best.hit.level.max(0.0) - self.level) / reach).clamp(0.0, 1.0);
        self.kin * self.edge.cone.say(&self.hit) * fade * fade
    }

    /// What a cone of the same branch does to light and colour.
    pub(super) fn chain(&self, job: &Job<'_>, surface: &mut Surface, best: &Best) {
        let weight = self.weight(best);
        if weight > 0.0 {
            surface.chain(self.edge, &self.hit, weight);
            surface.tint(color(job, self.edge, &self.hit), weight);
        } else if self.kin <= 0.0 {
            self.pass(job, surface, best);
        }
    }

    /// What another branch does, of which this is the highest cone.
    pub(super) fn meet(&self, job: &Job<'_>, (surface, best): (&mut Surface, &Best), tube: &Tube) {
        if self.kin <= 0.0 {
            return self.pass(job, surface, best);
        }
        let weight = self.weight(best);
        if weight > 0.0 {
            surface.tint(color(job, self.edge, &self.hit), weight);
        }
        let say =
            self.kin * self.edge.cone.say(&self.hit) * job.drawn[best.index as usize].cone.say(&best.hit);
        if say > 0.0 {
            let Tube { level, radius, offset, .. } = *tube;
            surface.join(&Part { level, radius, offset, bend: bend(self.edge, &self.hit) }, say);
        }
    }

    /// What a distant part does.
    fn pass(&self, job: &Job<'_>, surface: &mut Surface, best: &Best) {
        let hit = &self.hit;
        if hit.outside > self.fringe_px {
            // Beside the outline: a gap if this cone passes in front.
            if job.has_depth && hit.z > best.hit.z + 0.5 * self.radii {
                surface.gap = surface.gap.max((GAP_PX - hit.outside).clamp(0.0, 1.0));
            }
        } else {
            // The surfaces meet at an angle here, so the gap in height grows about as fast as the distance.
            let lower_px = best.hit.z - hit.z;
            surface.seam = surface.seam.max((1.0 - lower_px / SEAM_PX).clamp(0.0, 1.0));
        }
    }
}
