//! Which tip is the root.
//!
//! **Input** the tree of pieces, before pruning for the protected tips and after it for the choice. **Output** a tip,
//! and the runner-up.
//! **Policies** `thickest-tip`: the tip of the largest calibre (see [`calibre_mm`]); `superior`: the tip whose organ
//! reaches highest, by the third RAS coordinate of its end plus its calibre, since a thick branch's skeleton ends that
//! much earlier, among those of at least [`CALIBRE_SHARE`] of the largest calibre, since the bronchi of the apex of the
//! lung can reach higher than what a scan shows of the trachea; a point given by the user: the tip nearest to it. Ties go to the lower hub index; stubs of opened loops
//! are chosen only if there is nothing else.
//! **Why two times?** Spurs are no roots, so the choice comes after pruning; but a trunk can be so short that it
//! looks like a spur. So what the user's policy points at is protected from pruning, and so is a tip where the
//! scan's border cuts a vessel off at more than half of its fork's radius: no spur ends that way, unless it runs in the
//! lumen of another branch, such as the second of two centrelines in a wide trunk.

use std::cmp::Ordering;

use espalier_model::{Ledger, LedgerEntry, LedgerKind, Report};
use glam::DVec3;

use crate::curve::calibre_mm;
use crate::living::Living;
use crate::params::{Params, Root};
use crate::summary;

/// A vessel cut off by the border of the scan is no spur if its sphere has at least this share of its fork's radius.
const CUT_OFF_SHARE: f64 = 0.5;

/// The superior end of the trachea has at least this share of the largest calibre: a main bronchus has three quarters,
/// a segmental one a quarter.
const CALIBRE_SHARE: f64 = 0.5;
/// A lead of less than this share of the radius at the root is close: another scan of the same organ might say otherwise.
const CLOSE: f64 = 0.1;

/// The chosen tip and the next best one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Choice {
    /// The hub that is the root.
    pub(crate) root: usize,
    /// What the policy compares there, in mm.
    score_mm: f64,
    /// The hub that would be the root if `root` were not there, and its score.
    runner_up: Option<(usize, f64)>,
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
    let tips = living.tips();
    let calibres_mm: Vec<f64> = tips.iter().map(|&tip| tip_calibre_mm(living, tip)).collect();
    let largest_mm = calibres_mm.iter().copied().fold(0.0, f64::max);
    let mut ranked: Vec<(bool, f64, usize)> = Vec::new();
    for (&tip, &calibre_mm) in tips.iter().zip(&calibres_mm) {
        let hub = hubs[tip];
        let (is_second_choice, score_mm) = match (params.root_mm, params.root) {
            (Some(point), _) => (false, -hub.sample.position_mm.distance(DVec3::from_array(point))),
            (None, Root::Superior) => {
                (calibre_mm < CALIBRE_SHARE * largest_mm, hub.sample.position_mm.z + calibre_mm)
            }
            (None, Root::ThickestTip) => (false, calibre_mm),
        };
        ranked.push((hub.is_stub || is_second_choice, score_mm, tip));
    }
    ranked.sort_by(|a, b| better_first(*a, *b));
    let (_, score_mm, root) = ranked.first().copied().unwrap_or_default();
    Choice { root, score_mm, runner_up: ranked.get(1).map(|&(_, score_mm, tip)| (tip, score_mm)) }
}

/// Says in report and ledger which tip became the root, why, and what came second by how much.
pub(crate) fn describe(
    choice: &Choice,
    living: &Living<'_>,
    params: &Params,
    (ledger, report): (&mut Ledger, &mut Report),
) {
    let root = living.graph.hubs[choice.root].sample;
    let measure = match (params.root_mm, params.root) {
        (Some(_), _) => "minus the distance to root_mm",
        (None, Root::Superior) => "height of its end",
        (None, Root::ThickestTip) => "calibre",
    };
    let mut reason = format!("root by {measure}: {:.3} mm", choice.score_mm);
    let mut lead_mm = 0.0;
    if let Some((runner_up, score_mm)) = choice.runner_up {
        let second = living.graph.hubs[runner_up].sample.position_mm;
        lead_mm = choice.score_mm - score_mm;
        reason = format!(
            "{reason}; runner-up {score_mm:.3} mm at ({:.1}, {:.1}, {:.1})",
            second.x, second.y, second.z
        );
        let names = ["root_runner_up_x_mm", "root_runner_up_y_mm", "root_runner_up_z_mm"];
        summary::point(report, names, second);
        report.count("root_lead_mm", lead_mm);
        if params.root_mm.is_none() && lead_mm.abs() < CLOSE * root.radius_mm {
            report.warn("W-TREE-ROOT-CLOSE", format!("{reason}: set tree.root_mm if that is the root"));
        }
    }
    ledger.0.push(LedgerEntry {
        kind: LedgerKind::RootChosen,
        position_mm: root.position_mm,
        radius_mm: root.radius_mm,
        length_mm: lead_mm,
        reason,
    });
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
