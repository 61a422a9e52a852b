//! The parameters of tubes: `[embed.widths]` in the config.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::choices::WidthsMode;

/// What is done about tubes that overlap although their centrelines do not cross.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct WidthsParams {
    /// `report` only counts them, and says at which share of the radii there would be none. `avoid` lets lengths and
    /// angles give way until none are left, as far as it can, at the least energy that is found. `stretch` does the
    /// same, then scales all lengths against the radii, as little as it takes, so that none are left for sure; losses
    /// of length count that scale. Default `report`: lengths and angles are what the layout is for, and where tubes
    /// overlap the picture draws a seam between them.
    pub mode: WidthsMode,
}
