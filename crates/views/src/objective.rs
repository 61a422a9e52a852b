//! What a search minimises: the loss of a view, and a rule for equally good views.
//!
//! **Input** the [`Edges`] of a part; a reference frame.
//! **Output** [`Objective::at`], a number to compare directions by; [`Objective::seeds`], directions that every
//! search has to try.
//! **Notation** v a unit direction, r the reference direction, S the share of length shown.
//! **Steps** the number is loss(v) + 1e-9 (1 − S) + 1e-12 (1 − |v · r|). The seeds are r; r made perpendicular to
//! the longest edge; the normal of the longest edge and the edge that stands most across it.
//! **Guarantees** an answer for every part, and a stable one: of equally good directions the one that shows more
//! length, then the one nearest to the reference. On a straight chain that is the reference, turned the least so
//! that the chain is seen whole. Bends below about 0.1° count as straight. A planar part is seen along its normal.
//! Without edges it is the reference itself.
//! **Source** ours: [Hu2022] does not say what to do where its loss has many minima.
//! **Cost** O(edges) per direction.

use rayon::prelude::*;

use glam::DVec3;

use crate::frame::Frame;
use crate::metric::Edges;
use crate::params::Metric;

/// The price of length not shown: decides only among losses that are equal to some nine digits.
const PRICE_NOT_SHOWN: f64 = 1e-9;
/// The price of turning away from the reference: decides only after the length shown.
const PRICE_TURNED: f64 = 1e-12;
/// A direction of this value or less loses nothing that a search could find: it is the last price and rounding.
pub(crate) const LOSSLESS: f64 = 2.0 * PRICE_TURNED;
/// Sine below which two directions count as parallel.
const PARALLEL: f64 = 1e-9;
/// Edge visits that are worth a task of their own.
const VISITS_PER_TASK: usize = 20_000;

/// What a search minimises.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Objective<'a> {
    /// The edges to look at.
    pub(crate) edges: &'a Edges,
    /// Cells per side of a cube's face by which a search may gather edges; `None` where it can afford them all.
    pub(crate) cells: Option<usize>,
    /// How loss is measured.
    pub(crate) metric: Metric,
    /// Decides among equally good directions.
    pub(crate) reference: Frame,
}

impl Objective<'_> {
    /// The number to compare a direction by: less is better, and v and −v tie.
    pub(crate) fn at(&self, towards_camera: DVec3) -> f64 {
        let seen = self.edges.seen_from(towards_camera, self.metric);
        let turned = 1.0 - towards_camera.dot(self.reference.towards_camera).abs();
        seen.loss + PRICE_NOT_SHOWN * (1.0 - seen.shown) + PRICE_TURNED * turned
    }

    /// [`Objective::at`] of each direction, in order, in parallel where it pays.
    pub(crate) fn at_each(&self, directions: &[DVec3]) -> Vec<f64> {
        let directions_per_task = VISITS_PER_TASK / self.edges.len().max(1) + 1;
        directions.par_iter().with_min_len(directions_per_task).map(|&v| self.at(v)).collect()
    }

    /// Directions that hold the answer for straight, planar and empty parts.
    pub(crate) fn seeds(&self) -> Vec<DVec3> {
        let reference = self.reference.towards_camera;
        let Some(along) = self.edges.longest() else { return vec![reference] };
        let mut seeds = vec![reference, self.reference.nearest_across(along)];
        let across = |direction: DVec3| along.cross(direction);
        let most_across = self.edges.directions().map(across).reduce(|best, normal| {
            if normal.length_squared() > best.length_squared() { normal } else { best }
        });
        seeds.extend(most_across.filter(|normal| normal.length() > PARALLEL).map(DVec3::normalize));
        seeds
    }
}
