//! The topology ledger: everything that was cut, pruned, dropped or joined between the mask and the tree.

use glam::DVec3;

use crate::FileError;
use crate::table::{Column, Table, fixed};

/// What was done.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum LedgerKind {
    /// A connected component that is not part of the tree.
    ComponentDropped,
    /// A gap of the mask narrower than a ball, filled.
    GapClosed,
    /// A tunnel of the mask closed by changing a few voxels.
    TunnelClosed,
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
    /// An edge added between the tree and a component that was apart.
    GapBridged,
    /// The tip that became the root; the length is its lead over the next best.
    RootChosen,
}

impl LedgerKind {
    const ALL: [Self; 11] = [
        Self::ComponentDropped,
        Self::GapClosed,
        Self::TunnelClosed,
        Self::LoopCut,
        Self::SpurPruned,
        Self::TipExtended,
        Self::NodesMerged,
        Self::RootResolved,
        Self::RadiusRepaired,
        Self::GapBridged,
        Self::RootChosen,
    ];

    /// The name used in `topology.tsv`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::ComponentDropped => "component_dropped",
            Self::GapClosed => "gap_closed",
            Self::TunnelClosed => "tunnel_closed",
            Self::LoopCut => "loop_cut",
            Self::SpurPruned => "spur_pruned",
            Self::TipExtended => "tip_extended",
            Self::NodesMerged => "nodes_merged",
            Self::RootResolved => "root_resolved",
            Self::RadiusRepaired => "radius_repaired",
            Self::GapBridged => "gap_bridged",
            Self::RootChosen => "root_chosen",
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

/// The columns of `topology.tsv`.
pub const LEDGER_COLUMNS: [Column; 8] = [
    Column::new("entry", "n/a", "index of the entry, in the order in which things were done"),
    Column::new("kind", "n/a", "what was done"),
    Column::new("x_mm", "mm", "where, in space, RAS+: towards the right"),
    Column::new("y_mm", "mm", "where: towards the front"),
    Column::new("z_mm", "mm", "where: upwards"),
    Column::new("radius_mm", "mm", "the radius there"),
    Column::new("length_mm", "mm", "the length concerned, such as that of a pruned spur"),
    Column::new("reason", "n/a", "why, with the numbers that decided"),
];

/// The topology ledger of a run, in the order in which things were done.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Ledger(pub Vec<LedgerEntry>);

impl Ledger {
    /// The number of entries of a kind.
    #[must_use]
    pub fn n_of(&self, kind: LedgerKind) -> usize {
        self.0.iter().filter(|entry| entry.kind == kind).count()
    }

    /// The ledger of a table that [`Ledger::to_tsv`] made; lengths are rounded as there.
    ///
    /// # Errors
    /// [`FileError::Invalid`] with the line, if a column is missing, a number is none, or a kind is unknown.
    pub fn from_tsv(text: &str) -> Result<Self, FileError> {
        let entry = |(line_idx, line): (usize, &str)| {
            parse_entry(line).ok_or_else(|| FileError::Invalid {
                format: "topology.tsv",
                what: format!("line {} is no entry of a ledger: {line:.60}", line_idx + 1),
            })
        };
        text.lines().enumerate().skip(1).map(entry).collect::<Result<_, _>>().map(Self)
    }

    /// The table `topology.tsv`.
    #[must_use]
    pub fn to_tsv(&self) -> String {
        let mut table = Table::with(&LEDGER_COLUMNS);
        for (entry_idx, entry) in self.0.iter().enumerate() {
            let p = entry.position_mm;
            table.row(&[
                &entry_idx,
                &entry.kind.name(),
                &fixed(p.x, 4),
                &fixed(p.y, 4),
                &fixed(p.z, 4),
                &fixed(entry.radius_mm, 4),
                &fixed(entry.length_mm, 4),
                &entry.reason,
            ]);
        }
        table.into_string()
    }
}

fn parse_entry(line: &str) -> Option<LedgerEntry> {
    let [_, kind, x, y, z, radius, length, reason] = line.split('\t').collect::<Vec<_>>().try_into().ok()?;
    let number = |text: &str| if text == "n/a" { Some(f64::NAN) } else { text.parse().ok() };
    Some(LedgerEntry {
        kind: LedgerKind::ALL.into_iter().find(|known| known.name() == kind)?,
        position_mm: DVec3::new(number(x)?, number(y)?, number(z)?),
        radius_mm: number(radius)?,
        length_mm: number(length)?,
        reason: reason.to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_comes_back_as_it_was() {
        let entry = |kind, length_mm| LedgerEntry {
            kind,
            position_mm: DVec3::new(1.25, -0.5, 1e3),
            radius_mm: 0.75,
            length_mm,
            reason: format!("because of {length_mm} mm"),
        };
        let kinds = LedgerKind::ALL.into_iter().zip(0..);
        let ledger = Ledger(kinds.map(|(kind, length)| entry(kind, f64::from(length))).collect());
        let read = Ledger::from_tsv(&ledger.to_tsv()).expect("its own table");
        assert_eq!(read, ledger);
        assert!(Ledger::from_tsv("header\n0\tloop_cut\t1\t2\n").is_err());
        assert!(Ledger::from_tsv("header\n0\tloop_shut\t1\t2\t3\t4\t5\tx\n").is_err());
    }
}
