//! The topology ledger: everything that was cut, pruned, dropped or joined between the mask and the tree.

use glam::DVec3;

/// What was done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum LedgerKind {
    /// A connected component that is not part of the tree.
    ComponentDropped,
    /// An edge removed to open a loop.
    LoopCut,
    /// A short terminal branch removed.
    SpurPruned,
    /// A tip lengthened to the end of the mask.
    TipExtended,
    /// Nodes at one place merged into one.
    NodesMerged,
    /// A second root of a traced tree, dropped or joined.
    RootResolved,
    /// A radius that had to be repaired.
    RadiusRepaired,
}

impl LedgerKind {
    /// The name used in `topology.tsv`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::ComponentDropped => "component_dropped",
            Self::LoopCut => "loop_cut",
            Self::SpurPruned => "spur_pruned",
            Self::TipExtended => "tip_extended",
            Self::NodesMerged => "nodes_merged",
            Self::RootResolved => "root_resolved",
            Self::RadiusRepaired => "radius_repaired",
        }
    }
}

/// One entry of the ledger.
#[derive(Clone, Debug, PartialEq)]
pub struct LedgerEntry {
    /// What was done.
    pub kind: LedgerKind,
    /// Where, RAS+ mm.
    pub position_mm: DVec3,
    /// The radius there, in mm.
    pub radius_mm: f64,
    /// The length concerned (spur, extension, component), in mm.
    pub length_mm: f64,
    /// Why, as a phrase for people, with the numbers that decided.
    pub reason: String,
}

/// The topology ledger of a run, in the order in which things were done.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ledger(pub Vec<LedgerEntry>);

impl Ledger {
    /// The number of entries of a kind.
    #[must_use]
    pub fn n_of(&self, kind: LedgerKind) -> usize {
        self.0.iter().filter(|entry| entry.kind == kind).count()
    }

    /// The table `topology.tsv`.
    #[must_use]
    pub fn to_tsv(&self) -> String {
        let mut table = crate::table::Table::new(&[
            "entry",
            "kind",
            "x_mm",
            "y_mm",
            "z_mm",
            "radius_mm",
            "length_mm",
            "reason",
        ]);
        for (entry_idx, entry) in self.0.iter().enumerate() {
            let p = entry.position_mm;
            table.row(&[
                &entry_idx,
                &entry.kind.name(),
                &crate::table::fixed(p.x, 4),
                &crate::table::fixed(p.y, 4),
                &crate::table::fixed(p.z, 4),
                &crate::table::fixed(entry.radius_mm, 4),
                &crate::table::fixed(entry.length_mm, 4),
                &entry.reason,
            ]);
        }
        table.into_string()
    }
}
