//! The weights of the energy, as the config states them, and by node.
//!
//! **Input** weights of the whole, rules for parts. **Output** weights by node: those of the last rule that selects a
//! node and says one, else those of the whole. **Source** [Hu2022] section 3.3.

use espalier_model::{Branches, Tree};

/// The weights that a config states.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Weights {
    /// w_l of the whole.
    pub length: f64,
    /// w_a of the whole.
    pub angle: f64,
    /// w_s.
    pub side: f64,
    /// w_g.
    pub placement: f64,
    /// w_X, if it is a number.
    pub crossing: Option<f64>,
    /// Rules for parts.
    pub rules: Vec<Rule>,
}

/// Other weights where all of the conditions hold that are given.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rule {
    /// The generation of the branch, first and last.
    pub generations: Option<(u32, u32)>,
    /// The path in space from the root, least and most, in mm.
    pub depth_mm: Option<(f64, f64)>,
    /// The branch is one of these.
    pub branches: Option<Vec<u32>>,
    /// The node is one of these.
    pub nodes: Option<Vec<u32>>,
    /// w_l there.
    pub length: Option<f64>,
    /// w_a there.
    pub angle: Option<f64>,
}

/// Weights by node.
pub(crate) struct NodeWeights {
    pub(crate) length: Vec<f64>,
    pub(crate) angle: Vec<f64>,
    pub(crate) side: f64,
    pub(crate) placement: f64,
}

impl NodeWeights {
    pub(crate) fn new(tree: &Tree, branches: &Branches, weights: &Weights) -> Self {
        let n_nodes = tree.n_nodes();
        let mut depth_mm = vec![0.0; n_nodes];
        for (node, parent) in tree.edges() {
            depth_mm[node] = depth_mm[parent] + tree.edge_length_mm(node);
        }
        let selected: Vec<Vec<bool>> = weights
            .rules
            .iter()
            .map(|rule| (0..n_nodes).map(|node| rule.selects(node, branches, depth_mm[node])).collect())
            .collect();
        let by_node = |whole: f64, said: fn(&Rule) -> Option<f64>| {
            let last = |node: usize| {
                let rules = weights.rules.iter().zip(&selected).rev();
                rules.filter(|(_, selected)| selected[node]).find_map(|(rule, _)| said(rule))
            };
            (0..n_nodes).map(|node| last(node).unwrap_or(whole)).collect()
        };
        Self {
            length: by_node(weights.length, |rule| rule.length),
            angle: by_node(weights.angle, |rule| rule.angle),
            side: weights.side,
            placement: weights.placement,
        }
    }
}

impl Rule {
    fn selects(&self, node: usize, branches: &Branches, depth_mm: f64) -> bool {
        let Some(branch) = branches.of_node(node) else { return false };
        let generation = branches.list()[branch].generation;
        let names =
            |list: &Option<Vec<u32>>, idx: usize| list.as_ref().is_none_or(|ids| ids.contains(&(idx as u32)));
        self.generations.is_none_or(|(first, last)| first <= generation && generation <= last)
            && self.depth_mm.is_none_or(|(least, most)| least <= depth_mm && depth_mm <= most)
            && names(&self.branches, branch)
            && names(&self.nodes, node)
    }
}
