//! Letters beside long branches that run otherwise in space than the letters at the map's edges say.
//!
//! **Input** the map on its page, with what its right and up mean. **Output** texts that cover no branch and no other
//! mark.
//! **Steps** 1. Long branches whose chord in space leaves the direction that the map gives it by [`OFF_DEG`] or more, the
//! longest first. 2. Each takes the first free place beside its middle, its quarters, its end; without one it goes
//! unnamed.
//! **Guarantees** at most [`MOST`] texts; the same for the same page.
//! **Source** ours: a map keeps no directions, so one compass cannot speak for all branches.
//! **Cost** O(nodes + branches · log branches).

use espalier_geom::math;
use espalier_model::{Branches, Tree};
use glam::{DVec2, DVec3};

use crate::drawing::{Group, Mark};
use crate::furniture::direction_letters;
use crate::page::Page;
use crate::palette::PageColors;
use crate::params::Compass;
use crate::room::Grid;
use crate::scene::Scene;
use crate::text::{Anchor, Face};

/// The letters say at most "sin 20° of the axis", so less than this is within what they mean.
const OFF_DEG: f64 = 60.0;
/// Shorter branches have no letters, in layout units.
const SHORTEST: f64 = 5.0;
/// More letters than this nobody reads.
const MOST: usize = 14;
/// Font size, and the space to the branch, in layout units.
const SIZE: f64 = 1.15;
const SPACE: f64 = 0.45;

/// A map whose letters are asked for.
pub(crate) struct Map<'a> {
    /// The tree.
    pub tree: &'a Tree,
    /// Its branches.
    pub branches: &'a Branches,
    /// Where its nodes lie.
    pub scene: &'a Scene,
    /// The page.
    pub page: &'a Page,
    /// What points to the right and up.
    pub axes: [DVec3; 2],
}

/// The letters at branches, which take their places.
pub(crate) fn at_branches(
    map: &Map<'_>,
    room: &mut Grid,
    (face, colors): (&Face, &PageColors),
    kind: Compass,
) -> Group {
    let unit = map.page.unit_px;
    let mut marks = Vec::new();
    for (branch, direction) in map.strays() {
        if marks.len() == MOST {
            break;
        }
        let Some(text) = direction_letters(direction, kind).filter(|text| !text.is_empty()) else { continue };
        let size = DVec2::new(f64::from(face.width(&text, (SIZE * unit) as f32)), 0.75 * SIZE * unit);
        let Some(center) = map.places(branch, size).into_iter().find(|&at| room.is_free(at, size)) else {
            continue;
        };
        room.take(center - 0.5 * size, center + 0.5 * size);
        let at = center + DVec2::new(0.0, 0.5 * size.y);
        let (size_px, color) = (SIZE * unit, colors.ink);
        marks.push(Mark::Text { at, size_px, anchor: Anchor::Middle, is_strong: true, color, text });
    }
    Group { name: "branch-letters", marks }
}

impl Map<'_> {
    /// Long branches that leave the direction the map gives them, the longest first, each with where it points.
    fn strays(&self) -> Vec<(usize, DVec3)> {
        let [right, up] = self.axes;
        let mut found = Vec::new();
        for (branch_idx, branch) in self.branches.list().iter().enumerate() {
            let (hub, end) = (branch.hub, branch.end());
            let chord = self.scene.points_mm[end] - self.scene.points_mm[hub];
            let length_px = self.page.px_per_mm * chord.length();
            let space = (self.tree.position_mm(end) - self.tree.position_mm(hub)).try_normalize();
            if let (Some(map), Some(space)) = (chord.truncate().try_normalize(), space) {
                let cosine = space.dot(map.x * right + map.y * up).clamp(-1.0, 1.0);
                let is_long = length_px >= SHORTEST * self.page.unit_px;
                if is_long && math::acos(cosine).to_degrees() >= OFF_DEG {
                    found.push((branch_idx, space, length_px));
                }
            }
        }
        found.sort_by(|a, b| b.2.total_cmp(&a.2).then(a.0.cmp(&b.0)));
        found.into_iter().map(|(branch, space, _)| (branch, space)).collect()
    }

    /// Middles of boxes of this size beside a branch, the best place first.
    pub(crate) fn places(&self, branch: usize, size: DVec2) -> Vec<DVec2> {
        let nodes: Vec<usize> = self.branches.list()[branch].polyline().collect();
        let mut places = Vec::new();
        for share in [0.5, 0.35, 0.65, 0.8] {
            let last = nodes.len() - 1;
            let upper = ((share * last as f64) as usize).min(last - 1);
            let part = share * last as f64 - upper as f64;
            let [from, to] =
                [nodes[upper], nodes[upper + 1]].map(|n| self.page.px(self.scene.points_mm[n].truncate()));
            let Some(along) = (to - from).try_normalize() else { continue };
            let radius_px = self
                .page
                .radius_px(self.scene.radii_mm[nodes[upper]].max(self.scene.radii_mm[nodes[upper + 1]]));
            for across in [along.perp(), -along.perp()] {
                // The box touches the branch with whichever of its sides is nearer.
                let half = 0.5 * (size.x * across.x.abs() + size.y * across.y.abs());
                places.push(from.lerp(to, part) + across * (radius_px + SPACE * self.page.unit_px + half));
            }
        }
        places
    }
}
