//! Other weights for a part of the tree: `[[embed.weights]]` in the config.
//!
//! A rule says where and what. Where: by `generations`, `depth_mm`, `branches` or `nodes`; with several of them,
//! where all hold. What: `w_length`, `w_angle` or both, in place of those of `[embed]`. Of rules that meet, the
//! later one wins.

use espalier_model::diagnose::ParamError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::check_weight;

/// Weights for a part of the tree.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct WeightRule {
    /// Where: branches of these generations, `[first, last]`, both included. The generation of a branch is the
    /// number of forks between it and the root, as in `nodes.tsv`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub generations: Option<[u32; 2]>,
    /// Where: nodes at this depth, `[least, most]` in mm along the tree from the root, both included.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub depth_mm: Option<[f64; 2]>,
    /// Where: these branches, by their numbers in `nodes.tsv`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub branches: Option<Vec<u32>>,
    /// Where: these nodes, by their numbers in `nodes.tsv`: the edge that ends there, and its turn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nodes: Option<Vec<u32>>,
    /// The weight of the length ratios there, from 0 to 1e6, in place of `embed.w_length`. A branch has one length
    /// ratio: weights that differ within it are averaged over its edges.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub w_length: Option<f64>,
    /// The weight of the angle ratios there, from 0 to 1e6, in place of `embed.w_angle`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub w_angle: Option<f64>,
}

impl WeightRule {
    /// Checks the rule; `idx` is its place among the rules.
    pub(super) fn validate(&self, idx: usize) -> Result<(), ParamError> {
        let key = |name: &str| format!("weights[{idx}].{name}");
        let Self { generations, depth_mm, branches, nodes, w_length, w_angle } = self;
        if let Some([first, last]) = generations {
            let message = format!("must be [first, last] with first ≤ last, is [{first}, {last}]");
            ParamError::check(key("generations"), first <= last, message)?;
        }
        if let Some([least, most]) = depth_mm {
            let is_legal = *least >= 0.0 && least <= most && most.is_finite();
            let message = format!("must be [least, most] with 0 ≤ least ≤ most, is [{least}, {most}]");
            ParamError::check(key("depth_mm"), is_legal, message)?;
        }
        for (name, list) in [("branches", branches), ("nodes", nodes)] {
            let is_empty = list.as_ref().is_some_and(Vec::is_empty);
            ParamError::check(key(name), !is_empty, "must name at least one, is empty")?;
        }
        for (name, weight) in [("w_length", w_length), ("w_angle", w_angle)] {
            weight.map_or(Ok(()), |weight| check_weight(key(name), weight))?;
        }
        let rule = format!("weights[{idx}]");
        let says_where = generations.is_some() || depth_mm.is_some() || branches.is_some() || nodes.is_some();
        let message = "says not where: give generations, depth_mm, branches or nodes";
        ParamError::check(rule.clone(), says_where, message)?;
        let says_what = w_length.is_some() || w_angle.is_some();
        ParamError::check(rule, says_what, "says no weight: give w_length, w_angle or both")
    }
}
