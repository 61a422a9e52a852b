//! What is known of a layout at the widths of its tubes.

use serde::{Deserialize, Serialize};

/// What to do about tubes that overlap although their centrelines do not cross.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WidthMode {
    /// Nothing: the layout of centrelines stays, what overlaps is said.
    #[default]
    Report,
    /// Lengths and angles give way until nothing overlaps, as far as they can.
    Avoid,
    /// As `Avoid`; then the whole is scaled against its radii, as little as it takes until nothing overlaps.
    Stretch,
}

/// A layout at the widths of its tubes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Widths {
    /// What was done about overlaps.
    pub mode: WidthMode,
    /// Pairs of edges without a common node that overlap at full width.
    pub overlaps: usize,
    /// Whether all pairs were looked at; if not, `overlaps` is a lower bound and `radius_scale` an upper one.
    pub is_complete: bool,
    /// The largest factor on all radii, up to 1, at which nothing overlaps.
    pub radius_scale: f64,
    /// The factor by which lengths were scaled against radii; 1 unless the mode is `Stretch`.
    pub length_scale: f64,
    /// What the tubes cover at least in any layout with exact lengths in which they merge only near their forks.
    pub area_needed_mm2: f64,
    /// The disc about the root that no layout with exact lengths can leave.
    pub area_available_mm2: f64,
}

impl Widths {
    /// Whether no layout with exact lengths has room for the tubes: proven by the areas.
    #[must_use]
    pub fn are_impossible(&self) -> bool {
        self.area_needed_mm2 > self.area_available_mm2
    }
}
