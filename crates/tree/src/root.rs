//! Which tip is the root.
//!
//! **Input** the tree of pieces, before pruning for the protected tips and after it for the choice. **Output** a tip,
//! and the runner-up.
//! **Policies** `thickest-tip`: the tip of the largest calibre (see [`calibre_mm`]); `superior`: the tip whose organ
//! reaches highest, by the third RAS coordinate of its end plus its calibre, since a thick branch's skeleton ends that
//! much earlier; a point given by the user: the tip nearest to it. Ties go to the lower hub index; stubs of opened loops
//! are chosen only if there is nothing else.
//! **Why two times?** Spurs are no roots, so the choice comes after pruning; but a trunk can be so short that it
//! looks like a spur. So what the user's policy points at is protected from pruning, and so is a tip where the
//! scan's border cuts a vessel off at more than half of its fork's radius: no spur ends that way, unless it runs in the
//! lumen of another branch, such as the second of two centrelines in a wide trunk.

use std::cmp::Ordering;

use glam::DVec3;

use crate::curve::calibre_mm;
use crate::living::Living;
use crate::params::{Params, Root};

/// A vessel cut off by the border of the scan is no spur if its sphere has at least this share of its fork's radius.
const CUT_OFF_SHARE: f64 = 0.5;

/// The chosen tip and the next best one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Choice {
    /// The hub that is the root.
    pub(crate) root: usize,
    /// The hub that would be the root if `root` were not there.
    pub(crate) runner_up: Option<usize>,
}

/// What pruning must leave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Protection {
    /// Nothing: not a tip, or a tip like others.
    Free,
    /// Not to be taken for being short: the scan cuts a vessel off there.
    CutOff,
    /// Not to be taken at all: the user's policy points at it.
    Root,
}

/// For each hub what pruning must respect there.
pub(crate) fn protected_tips(living: &mut Living<'_>, params: &Params) -> Vec<Protection> {
    let mut protection = vec![Protection::Free; living.graph.hubs.len()];
    for tip in living.tips() {
        let hub = living.graph.hubs[tip];
        let fork_radius_mm =
            living.run_at_tip(tip).map_or(0.0, |(_, fork)| living.graph.hubs[fork].sample.radius_mm);
        if hub.is_at_border && hub.sample.radius_mm >= CUT_OFF_SHARE * fork_radius_mm {
            protection[tip] = Protection::CutOff;
        }
    }
    if params.root_mm.is_some() || params.root == Root::Superior {
        protection[choose(living, params).root] = Protection::Root;
    }
    protection
}

/// The root by policy.
pub(crate) fn choose(living: &Living<'_>, params: &Params) -> Choice {
    let hubs = &living.graph.hubs;
    let score = |tip: usize| match (params.root_mm, params.root) {
        (Some(point), _) => -hubs[tip].sample.position_mm.distance(DVec3::from_array(point)),
        (None, Root::Superior) => hubs[tip].sample.position_mm.z + tip_calibre_mm(living, tip),
        (None, Root::ThickestTip) => tip_calibre_mm(living, tip),
    };
    let mut ranked: Vec<(bool, f64, usize)> =
        living.tips().into_iter().map(|tip| (hubs[tip].is_stub, score(tip), tip)).collect();
    ranked.sort_by(|a, b| better_first(*a, *b));
    Choice { root: ranked.first().map_or(0, |r| r.2), runner_up: ranked.get(1).map(|r| r.2) }
}

fn better_first(a: (bool, f64, usize), b: (bool, f64, usize)) -> Ordering {
    a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)).then(a.2.cmp(&b.2))
}

/// The calibre of a tip, in mm.
fn tip_calibre_mm(living: &Living<'_>, tip: usize) -> f64 {
    let sample = living.graph.hubs[tip].sample;
    let Some(piece) = living.pieces_at(tip).next() else { return sample.radius_mm };
    let (branch, ..) = living.branch_from(tip, piece);
    calibre_mm(&branch, sample)
}
