//! Parameters of thinning.

use espalier_model::diagnose::ParamError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of thinning: `[skeleton]` in the config.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Params {
    /// The thinning rule. Default `safe`: the published rule makes bars of even width vanish.
    pub thinning: Thinning,
}

/// Which rule decides what is deleted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Thinning {
    /// Ours: nothing vanishes, components and Euler number stay, tubes keep their length.
    #[default]
    Safe,
    /// As published in [Lee94] and implemented in scikit-image and ITK, bit for bit. May lose thin parts of even
    /// width and may change the topology, which the report then says.
    Lee94,
}

impl Params {
    /// The values that the paper's skeletons come nearest to: the published thinning rule.
    ///
    /// [Hu2022] takes its vessel skeletons from another program, so only the class of the method is theirs.
    #[must_use]
    pub fn paper() -> Self {
        Self { thinning: Thinning::Lee94 }
    }

    /// Checks the ranges: every value of these types is legal.
    ///
    /// # Errors
    /// None today; the signature is that of every stage.
    pub fn validate(&self) -> Result<(), ParamError> {
        Ok(())
    }
}
