//! The parameters of the page.

use espalier_model::diagnose::ParamError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The parameters of the page.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Params {
    /// Whether `report.html` is made. Default true; `methods.md` and `references.bib` are made either way.
    pub enabled: bool,
    /// The heading of the page. Default: the name of the run; where that is only the name of the input's file, which may
    /// be a patient's, what kind of tree it is.
    pub title: Option<String>,
    /// Rows of a table that the page shows, 10 to 5000; a line under a longer table names the file that has all.
    /// Default 300: on paper some six pages. Larger makes the page larger and slower to sort.
    pub max_rows: usize,
}

impl Default for Params {
    fn default() -> Self {
        Self { enabled: true, title: None, max_rows: 300 }
    }
}

impl Params {
    /// Checks every range.
    ///
    /// # Errors
    /// The first key outside its range.
    pub fn validate(&self) -> Result<(), ParamError> {
        let title_chars = self.title.as_ref().map_or(0, |title| title.chars().count());
        ParamError::check(
            "title",
            title_chars <= 500,
            format!("must be at most 500 characters, is {title_chars}"),
        )?;
        ParamError::check(
            "max_rows",
            (10..=5000).contains(&self.max_rows),
            format!("must be 10 to 5000, is {}", self.max_rows),
        )
    }
}
