//! A tree laid flat.
//!
//! These types are their own file: the names and the order of their fields are the format, and a change of either needs
//! the next version (see `file`).

mod comparison;
mod file;
mod losses;
mod nodes;
mod runs;
mod widths;

use glam::DVec2;
use serde::{Deserialize, Serialize};

pub use comparison::{CompareCell, CompareColumn, ComparedLayout, Comparison, compare_columns};
pub use losses::{Better, LossColumn, Losses};
pub use nodes::NODE_COLUMNS;
pub use runs::{ComparedRun, ComparedRuns, RUN_COLUMN};
pub use widths::{WidthMode, Widths};

use crate::edits::Edit;
use file::EditRecordFile;

/// Where target angles come from (section 3.2.1 of [Hu2022]).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TargetKind {
    /// The exact angle in three dimensions; the local plane only tells the side.
    #[default]
    Intrinsic,
    /// The paper's: the angle measured in the local plane.
    Projected,
    /// As `Intrinsic`, with sides that were searched so that fewer branches cross: a local plane and its mirror
    /// image are equally good views.
    IntrinsicMirrored,
    /// As `Projected`, with sides that were searched.
    ProjectedMirrored,
}

impl TargetKind {
    /// The same with sides that were searched.
    #[must_use]
    pub fn mirrored(self) -> Self {
        match self {
            Self::Intrinsic | Self::IntrinsicMirrored => Self::IntrinsicMirrored,
            Self::Projected | Self::ProjectedMirrored => Self::ProjectedMirrored,
        }
    }

    /// The same with the sides of the local planes.
    #[must_use]
    pub fn unmirrored(self) -> Self {
        match self {
            Self::Intrinsic | Self::IntrinsicMirrored => Self::Intrinsic,
            Self::Projected | Self::ProjectedMirrored => Self::Projected,
        }
    }
}

/// What an embedding aims at, by node; frozen before any method runs, and in the handedness of the global view: in
/// a picture that is reflected (see [`Pose`]) angles run the other way round.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Targets {
    /// How they were made.
    pub kind: TargetKind,
    /// The target node angle θ in (0, 2π): counter-clockwise from (parent → grandparent) to (parent → node),
    /// π = straight. For a child of the root the grandparent is virtual, in the middle of the largest gap, and
    /// no loss is counted. `NaN` for the root.
    #[serde(with = "file::none_for_nan")]
    pub angle_rad: Vec<f64>,
    /// The target edge length: the length in three dimensions, in mm. 0 for the root.
    pub length_mm: Vec<f64>,
    /// The heading of the edge in the global view, radians counter-clockwise from right; 0 for the root.
    pub heading_rad: Vec<f64>,
    /// How far the global view can tell that heading: projected length / length, in [0, 1]; 0 for the root.
    pub confidence: Vec<f64>,
}

/// The one energy by which every method is judged (section 3.2.2 of [Hu2022], Eq. 4), by parts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Energy {
    /// Σ over branches of w_l · mean r_l².
    pub length: f64,
    /// Σ over branches of w_a · mean r_a².
    pub angle: f64,
    /// Ours: Σ over branches of w_s · mean of how far a turn is on the other side of its target, in [0, 1].
    pub side: f64,
    /// The relative placement term, ours: w_g (M/L) Σ conf² l (h − H)².
    pub placement: f64,
    /// w_X · crossings.
    pub crossing: f64,
}

impl Energy {
    /// The sum of the parts.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.length + self.angle + self.side + self.placement + self.crossing
    }
}

/// The statement that an embedding has no crossings, or where it has them: exact, over the written coordinates.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Certificate {
    /// How many pairs of edges have a point in common that they should not have.
    pub crossings: usize,
    /// The first such pairs, each edge by its lower node, at most [`Certificate::MAX_PAIRS`].
    pub pairs: Vec<(usize, usize)>,
}

impl Certificate {
    /// How many pairs are kept.
    pub const MAX_PAIRS: usize = 100;

    /// Whether the embedding is free of crossings.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.crossings == 0
    }
}

/// The rigid motion (and mirror) of the whole that was applied last. It costs no energy and no loss: all of them
/// are those of the layout before it was reflected.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pose {
    /// Rotation counter-clockwise in radians, applied after the reflection.
    pub rotation_rad: f64,
    /// Whether the whole was reflected (x → −x).
    pub is_reflected: bool,
}

/// Why an optimisation ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Termination {
    /// Nothing to optimise, or a constructive method.
    #[default]
    Constructed,
    /// No length, angle or crossing is lost: proven optimal for its targets.
    Optimal,
    /// Another round would have gained too little.
    Converged,
    /// The work allowed was done.
    BudgetSpent,
}

/// What a method had just done when a point of its convergence curve was taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Phase {
    /// Nothing: the layout that it begins with.
    Start,
    /// The targets bent until they do not cross.
    Untangling,
    /// A few ratios at a time towards 0.
    Descent,
    /// All ratios at once under a barrier.
    Barrier,
    /// An iteration of the swarm.
    Swarm,
}

impl Phase {
    /// The name in tables and figures.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Untangling => "untangling",
            Self::Descent => "descent",
            Self::Barrier => "barrier",
            Self::Swarm => "swarm",
        }
    }
}

/// One point of a convergence curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TracePoint {
    /// What has just been done.
    pub phase: Phase,
    /// The iteration; 0 is the start.
    pub iteration: u32,
    /// Evaluations of the energy so far.
    pub evaluations: u64,
    /// The best total energy so far.
    pub energy: f64,
    /// The crossings of that best.
    pub crossings: usize,
}

/// One method's row in `compare.tsv`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MethodRow {
    /// The method's name, such as `radial`, with its size where that matters.
    pub method: String,
    /// Crossings, exact.
    pub crossings: usize,
    /// Pairs of edges that are not neighbours and overlap at their radii.
    pub overlaps: usize,
    /// The one energy.
    pub energy: Energy,
    /// The losses.
    pub losses: Losses,
    /// Evaluations of the energy.
    pub evaluations: u64,
    /// Against which targets it was scored.
    pub targets: TargetKind,
}

/// A manual edit and what came of it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "EditRecordFile", into = "EditRecordFile")]
pub struct EditRecord {
    /// What was asked for.
    pub edit: Edit,
    /// By how much the branch is turned in the end, in degrees counter-clockwise in the picture: as asked, up to
    /// the rounding of coordinates.
    pub angle_reached_deg: f64,
    /// Crossings that the edit brought about.
    pub crossings_introduced: usize,
    /// How many of them were removed before the next edit.
    pub crossings_removed: usize,
    /// The total energy before the edit.
    pub energy_before: f64,
    /// The total energy when the rest had been optimised around it.
    pub energy_after: f64,
}

/// A tree laid flat.
///
/// **Guarantees** one entry per node of its tree in every per-node vector; positions are finite and rounded to
/// `quantum_mm`, exactly as they are written; the certificate is for these numbers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Embedding {
    /// The digest of its tree: [`Tree::digest`](crate::Tree::digest).
    pub tree: String,
    /// The method whose layout this is.
    pub method: String,
    /// The seed it was made with.
    pub seed: u64,
    /// The targets.
    pub targets: Targets,
    /// Why it ended.
    pub termination: Termination,
    /// The step to which coordinates are rounded, a power of ten, in mm.
    pub quantum_mm: f64,
    /// The last rigid motion.
    pub pose: Pose,
    /// The certificate.
    pub certificate: Certificate,
    /// What is known of it at the widths of the tubes.
    pub widths: Widths,
    /// The one energy.
    pub energy: Energy,
    /// The losses.
    pub losses: Losses,
    /// All methods that ran, scored alike, this one among them.
    pub methods: Vec<MethodRow>,
    /// The manual edits that were made after them, in order; none as a rule.
    pub edits: Vec<EditRecord>,
    /// The convergence curve of the method that was asked for, whether or not its layout won; empty if it does not
    /// search.
    pub trace: Vec<TracePoint>,
    /// Where each node lies, plane mm: x to the right, y up.
    pub positions_mm: Vec<DVec2>,
    /// r_l of each node's edge; 0 for the root.
    pub length_ratio: Vec<f64>,
    /// r_a of each node; 0 for the root and its children.
    pub angle_ratio: Vec<f64>,
}
