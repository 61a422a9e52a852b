//! What is measured on a tree, and its tables.
//!
//! | type | table |
//! |---|---|
//! | [`BranchMeasures`] | `branches.tsv`; also the cell arrays of `tree.vtp` and the edges of `tree.graphml` |
//! | [`GenerationSummary`] | `generations.tsv` |
//! | [`ProfileRow`] | `profiles.tsv` |
//! | [`Stenosis`] | `stenoses.tsv` |
//!
//! Branches are numbered from 0 in preorder, as [`Tree::branches`](crate::Tree::branches) lists them, in every file.
//! Numbers are written with seven significant digits, since the same table serves lungs and neurites; `n/a` where
//! there is none.

mod branches;
mod generations;
mod profiles;
mod stenoses;

use crate::table::{Digits, significant};

pub use branches::{BranchMeasures, Measure, MeasureValue, Region, branch_measures};
pub use generations::{GENERATION_COLUMNS, GenerationSummary, Spread};
pub use profiles::{PROFILE_COLUMNS, ProfileRow};
pub use stenoses::{STENOSIS_COLUMNS, Stenosis};

/// Everything that is measured on a tree.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Anatomy {
    /// One for each branch, in the order of [`Tree::branches`](crate::Tree::branches).
    pub branches: Vec<BranchMeasures>,
    /// One for each generation, from 0.
    pub generations: Vec<GenerationSummary>,
    /// The calibre along each branch, from its fork outwards.
    pub profile: Vec<ProfileRow>,
    /// Narrow places, the narrowest first.
    pub stenoses: Vec<Stenosis>,
}

impl Anatomy {
    /// The table `branches.tsv`.
    #[must_use]
    pub fn branches_tsv(&self) -> String {
        branches::to_tsv(&self.branches)
    }

    /// The table `generations.tsv`.
    #[must_use]
    pub fn generations_tsv(&self) -> String {
        generations::to_tsv(&self.generations)
    }

    /// The table `profiles.tsv`.
    #[must_use]
    pub fn profiles_tsv(&self) -> String {
        profiles::to_tsv(&self.profile)
    }

    /// The table `stenoses.tsv`.
    #[must_use]
    pub fn stenoses_tsv(&self) -> String {
        stenoses::to_tsv(&self.stenoses)
    }
}

/// The significant digits of measures in tables.
const DIGITS: Digits = Digits::Significant(7);

fn number(value: f64) -> String {
    DIGITS.text(value)
}

fn or_none(index: Option<usize>) -> String {
    index.map_or_else(|| "n/a".to_owned(), |index| index.to_string())
}

/// A share as a percentage, with as many digits as it deserves.
fn percent(value: f64) -> String {
    if value.is_nan() { "n/a".to_owned() } else { significant(value, 4) }
}
