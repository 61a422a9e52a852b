//! The parameters of the juxtaposition.

use espalier_model::diagnose::ParamError;
use serde::{Deserialize, Serialize};

/// How the follow-up is brought into the frame of the baseline.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Align {
    /// Turned and moved until matched forks lie on each other as nearly as can be.
    #[default]
    Rigid,
    /// Scaled too, as for an animal that grew. Lengths and radii in tables stay each tree's own.
    Similarity,
    /// Taken as it is: both trees are in one frame already.
    AsIs,
}

impl Align {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Rigid, Self::Similarity, Self::AsIs];

    /// The name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Rigid => "rigid",
            Self::Similarity => "similarity",
            Self::AsIs => "as-is",
        }
    }
}

/// The parameters of the juxtaposition.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Params {
    /// How the follow-up is brought into the frame of the baseline. Default rigid: calibres and lengths may differ, the
    /// body's size does not.
    pub align: Align,
    /// What a difference of radius costs a pair of branches, per octave and as a share of the shorter one's length; 0 to
    /// 2. Default 0.25: a branch narrowed to a half still matches unless another lies nearer. Larger: branches of one
    /// calibre match rather than those in one place.
    pub radius_weight: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self { align: Align::Rigid, radius_weight: 0.25 }
    }
}

impl Params {
    /// Checks every range.
    ///
    /// # Errors
    /// The first key outside its range.
    pub fn validate(&self) -> Result<(), ParamError> {
        let weight = self.radius_weight;
        ParamError::check(
            "radius_weight",
            (0.0..=2.0).contains(&weight),
            format!("must be 0 to 2, is {weight}"),
        )
    }
}
