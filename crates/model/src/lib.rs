//! The hand-over types between stages, with their invariants and their files.
//!
//! | type | made by | used by | file |
//! |---|---|---|---|
//! | [`Volume`] | `volume`, `phantom` | `volume` | `.nii.gz` |
//! | [`Mask`] | `volume`, `phantom` | `skeleton`, `radius`, `tree` | `mask.nii.gz` |
//! | [`Skeleton`] | `skeleton` | `radius`, `tree` | `skeleton.nii.gz` |
//! | [`InscribedSpheres`] | `radius` | `tree` | `spheres.tsv`, `radius.nii.gz` |
//! | [`swc::Traced`] | a tracing program, `phantom` | `tree` | `.swc` |
//! | [`Tree`] | `tree` | `views`, `embed`, `render` | `tree.swc` |
//! | [`Ledger`] | `tree` | the reader | `topology.tsv` |
//! | [`Anatomy`] | `tree` | the reader | `branches.tsv`, `generations.tsv`, `profiles.tsv`, `stenoses.tsv` |
//! | [`Tree`] and [`Anatomy`] | `tree` | other programs | `tree.vtp`, `tree.graphml`, `branches.nii.gz` |
//! | [`ViewHierarchy`] | `views` | `embed`, `render` | `views.json` |
//! | [`Edits`] | the user | `embed` | `edits.json` |
//! | [`Embedding`] | `embed` | `render` | `embedding.json` |
//! | [`Report`] | every stage | the reader | `report.json` |
//!
//! **Spaces** World points are RAS+ mm; voxel coordinates are (x, y, z) with the voxel's centre at whole
//! numbers; picture points are plane mm.
//!
//! **Architecture Invariant:** no algorithms here, though bits can be counted, and no file access: files are bytes in and bytes out.

/// How far a coordinate or a radius of a traced tree may be from 0, in mm: far beyond any organ in any unit that
/// somebody took for mm, and a tenth of what a picture holds.
pub(crate) const MAX_MM: f64 = 1e11;

pub mod anatomy;
mod bits;
pub mod bytes;
pub mod diagnose;
mod digest;
mod edits;
mod embedding;
pub mod graphml_out;
mod grid;
mod juxtaposition;
pub mod label_table;
mod ledger;
mod mask;
pub mod nifti_out;
pub mod polydata;
mod report;
mod skeleton;
mod spheres;
pub mod swc;
pub mod table;
mod tree;
mod turn;
mod versioned;
mod views;
mod volume;
pub mod vtp_out;
pub mod xml;

pub use anatomy::{Anatomy, BranchMeasures, Region};
pub use bits::{Bits, EULER_OF_BLOCK};
pub use diagnose::Diagnose;
pub use edits::{Edit, EditError, Edits};
pub use embedding::{
    Better, Certificate, CompareCell, CompareColumn, ComparedLayout, ComparedRun, ComparedRuns, Comparison,
    EditRecord, Embedding, Energy, LossColumn, Losses, MethodRow, NODE_COLUMNS, Phase, Pose, RUN_COLUMN,
    TargetKind, Targets, Termination, TracePoint, WidthMode, Widths, compare_columns,
};
pub use grid::{Grid, GridError, RAS_FROM_LPS};
pub use juxtaposition::{
    Alignment, BranchChange, CHANGE_COLUMNS, Fate, Juxtaposition, SHARED_NODE_COLUMNS, SharedNode,
    change_percent,
};
pub use ledger::{LEDGER_COLUMNS, Ledger, LedgerEntry, LedgerKind};
pub use mask::Mask;
pub use report::{Count, Report, Warning};
pub use skeleton::Skeleton;
pub use spheres::{InscribedSpheres, SPHERE_COLUMNS, Sphere};
pub use tree::{Branch, Branches, Node, Tree, TreeError};
pub use versioned::FileError;
pub use views::{LocalPlane, SubtreeView, View, ViewHierarchy, view_axes_from_json};
pub use volume::{Volume, Voxels};
