//! The figures of the stage's report.

use espalier_model::{Ledger, LedgerKind, Report, Tree};
use glam::DVec3;

/// A larger share of the centreline in dropped components deserves a warning.
const MAX_DROPPED: f64 = 0.05;

/// Counts that every tree has, and those of its ledger.
pub(crate) fn describe(tree: &Tree, ledger: &Ledger, report: &mut Report) {
    let branches = tree.branches();
    let generations = branches.list().iter().map(|b| b.generation as usize + 1).max().unwrap_or(0);
    let length_mm = tree.length_mm();
    report.count_usize("nodes", tree.n_nodes());
    report.count_usize("branches", branches.list().len());
    report.count_usize("tips", tree.n_tips());
    report.count_usize("generations", generations);
    report.count("length_mm", length_mm);
    report.count("mean_radius_mm", tree.mean_radius_mm());
    report.count("nodes_per_mm", if length_mm > 0.0 { tree.n_nodes() as f64 / length_mm } else { 0.0 });
    for (name, kind) in [
        ("components_dropped", LedgerKind::ComponentDropped),
        ("gaps_bridged", LedgerKind::GapBridged),
        ("loops_cut", LedgerKind::LoopCut),
        ("spurs_pruned", LedgerKind::SpurPruned),
        ("tips_extended", LedgerKind::TipExtended),
        ("nodes_merged", LedgerKind::NodesMerged),
        ("roots_resolved", LedgerKind::RootResolved),
        ("radii_repaired", LedgerKind::RadiusRepaired),
    ] {
        report.count_usize(name, ledger.n_of(kind));
    }
    point(report, ["root_x_mm", "root_y_mm", "root_z_mm"], tree.position_mm(0));

    // Islands of noise are short; a lung or a lobe that is missing from the picture is not.
    let dropped_mm: f64 = ledger
        .0
        .iter()
        .filter(|entry| entry.kind == LedgerKind::ComponentDropped)
        .map(|entry| entry.length_mm)
        .sum();
    let share = dropped_mm / (dropped_mm + length_mm).max(f64::MIN_POSITIVE);
    if share > MAX_DROPPED {
        report.warn(
            "W-TREE-DROPPED",
            format!(
                "{:.0} % of the centreline lie in components that are not part of the tree: set tree.components = \"all\" for one tree of a forest, or make a run of each",
                100.0 * share
            ),
        );
    }

    let n_without_radius = tree.nodes().iter().filter(|node| node.radius_mm <= 0.0).count();
    if n_without_radius > 0 {
        report.warn(
            "W-TREE-NO-RADIUS",
            format!("{n_without_radius} of {} nodes have radius 0", tree.n_nodes()),
        );
    }
}

/// Three counts for a point.
pub(crate) fn point(report: &mut Report, names: [&'static str; 3], position_mm: DVec3) {
    for (name, value) in names.into_iter().zip(position_mm.to_array()) {
        report.count(name, value);
    }
}
