//! The weights of each node: those of the whole tree, and the user's for parts of it.
//!
//! **Input** a tree, its branches, params. **Output** w_l and w_a of each node.
//! **Steps** every node has the weights of the whole; each rule, in order, replaces those of the nodes it selects.
//! **Guarantees** rules that say what the whole says change nothing, to the bit.
//! **Source** [Hu2022] section 3.3, and section 5.3.1: "nodes with the shorter depth can be assigned a higher w_l".
//! **Cost** O(N log n) for a rule that names n branches or nodes.

use espalier_model::diagnose::ParamError;
use espalier_model::{Branches, Report, Tree};

use crate::params::{Params, WeightRule};

/// Weights by node.
pub(crate) struct Weights {
    pub(crate) length: Vec<f64>,
    pub(crate) angle: Vec<f64>,
}

impl Weights {
    /// The weights that params give to each node.
    pub(crate) fn new(tree: &Tree, branches: &Branches, params: &Params) -> Self {
        let n_nodes = tree.n_nodes();
        let mut weights =
            Self { length: vec![params.w_length; n_nodes], angle: vec![params.w_angle; n_nodes] };
        let depth_mm = depths_mm(tree);
        for rule in &params.weights {
            for node in selected(rule, branches, &depth_mm) {
                weights.length[node] = rule.w_length.unwrap_or(weights.length[node]);
                weights.angle[node] = rule.w_angle.unwrap_or(weights.angle[node]);
            }
        }
        weights
    }

    /// The largest w_l and the largest w_a of any edge; of the whole where there is no edge.
    pub(crate) fn largest(&self) -> (f64, f64) {
        let largest = |weights: &[f64]| weights[1..].iter().copied().reduce(f64::max).unwrap_or(weights[0]);
        (largest(&self.length), largest(&self.angle))
    }
}

/// Checks that the branches and nodes that rules name are there, and warns of rules that select nothing.
pub(crate) fn check(tree: &Tree, branches: &Branches, params: &Params) -> Result<Report, ParamError> {
    let depth_mm = depths_mm(tree);
    let mut report = Report::default();
    for (idx, rule) in params.weights.iter().enumerate() {
        let n_branches = branches.list().len() as u32;
        check_ids(idx, "branches", &rule.branches, 0..n_branches)?;
        check_ids(idx, "nodes", &rule.nodes, 1..tree.n_nodes() as u32)?;
        if selected(rule, branches, &depth_mm).next().is_none() {
            let last = branches.list().iter().map(|branch| branch.generation).max().unwrap_or(0);
            let deepest = depth_mm.iter().copied().fold(0.0, f64::max);
            report.warn(
                "W-EMBED-NO-SUCH-PART",
                format!(
                    "embed.weights[{idx}] selects nothing; the tree has generations 0 to {last} and is \
                     {deepest:.3} mm deep"
                ),
            );
        }
    }
    Ok(report)
}

fn check_ids(
    idx: usize,
    name: &str,
    ids: &Option<Vec<u32>>,
    legal: std::ops::Range<u32>,
) -> Result<(), ParamError> {
    let stray = ids.iter().flatten().find(|id| !legal.contains(id));
    stray.map_or(Ok(()), |id| {
        let message = if legal.is_empty() {
            format!("there is no {id}: the tree has a single node, and nothing to weigh")
        } else {
            format!("there is no {id}: they are {} to {}", legal.start, legal.end - 1)
        };
        ParamError::check(format!("weights[{idx}].{name}"), false, message)
    })
}

/// The nodes that a rule selects; never the root, which has neither edge nor turn.
fn selected<'a>(
    rule: &'a WeightRule,
    branches: &'a Branches,
    depth_mm: &'a [f64],
) -> impl Iterator<Item = usize> + 'a {
    let [branch_ids, node_ids] = [&rule.branches, &rule.nodes].map(sorted);
    let holds = move |node: usize| {
        let branch = branches.of_node(node).unwrap_or(0);
        let generation = branches.list()[branch].generation;
        let within = |range: &[u32; 2]| (range[0]..=range[1]).contains(&generation);
        let deep = |range: &[f64; 2]| (range[0]..=range[1]).contains(&depth_mm[node]);
        rule.generations.as_ref().is_none_or(within)
            && rule.depth_mm.as_ref().is_none_or(deep)
            && branch_ids.as_ref().is_none_or(|ids| ids.binary_search(&(branch as u32)).is_ok())
            && node_ids.as_ref().is_none_or(|ids| ids.binary_search(&(node as u32)).is_ok())
    };
    (1..depth_mm.len()).filter(move |&node| holds(node))
}

fn sorted(ids: &Option<Vec<u32>>) -> Option<Vec<u32>> {
    let mut ids = ids.clone()?;
    ids.sort_unstable();
    Some(ids)
}

fn depths_mm(tree: &Tree) -> Vec<f64> {
    let mut depth_mm = vec![0.0; tree.n_nodes()];
    for (node, parent) in tree.edges() {
        depth_mm[node] = depth_mm[parent] + tree.edge_length_mm(node);
    }
    depth_mm
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common::tree_of;

    /// A stem of two edges, a fork, a branch of two edges and a branch of one.
    fn fork() -> Tree {
        tree_of(&[
            (0.0, 0.0, 0.0, None),
            (0.0, 1.0, 0.0, Some(0)),
            (0.0, 2.0, 0.0, Some(1)),
            (1.0, 2.0, 0.0, Some(2)),
            (2.0, 2.0, 0.0, Some(3)),
            (-1.0, 2.0, 0.0, Some(2)),
        ])
    }

    fn weights(rules: &[WeightRule]) -> Weights {
        let tree = fork();
        let params = Params { weights: rules.to_vec(), ..Params::default() };
        Weights::new(&tree, &tree.branches(), &params)
    }

    #[test]
    fn each_selector_selects() {
        let lengths = |rule: WeightRule| weights(&[WeightRule { w_length: Some(7.0), ..rule }]).length;
        let rule = WeightRule::default;
        let by = |selected: [usize; 6]| selected.map(|is_in| if is_in == 1 { 7.0 } else { 2.0 });
        for (rule, expected) in [
            (WeightRule { generations: Some([0, 0]), ..rule() }, [0, 1, 1, 0, 0, 0]),
            (WeightRule { generations: Some([1, 9]), ..rule() }, [0, 0, 0, 1, 1, 1]),
            (WeightRule { depth_mm: Some([2.0, 3.0]), ..rule() }, [0, 0, 1, 1, 0, 1]),
            (WeightRule { branches: Some(vec![2, 0]), ..rule() }, [0, 1, 1, 0, 0, 1]),
            (WeightRule { nodes: Some(vec![4]), ..rule() }, [0, 0, 0, 0, 1, 0]),
            (
                WeightRule { branches: Some(vec![1]), depth_mm: Some([0.0, 3.5]), ..rule() },
                [0, 0, 0, 1, 0, 0],
            ),
            (WeightRule { depth_mm: Some([50.0, 60.0]), ..rule() }, [0; 6]),
        ] {
            assert_eq!(lengths(rule.clone()), by(expected), "{rule:?}");
        }
    }

    #[test]
    fn later_rules_win_and_leave_what_they_do_not_name() {
        let rule = WeightRule { generations: Some([0, 5]), w_length: Some(7.0), ..WeightRule::default() };
        let later = WeightRule { nodes: Some(vec![3]), w_length: Some(9.0), ..WeightRule::default() };
        let angle = WeightRule { nodes: Some(vec![3, 4]), w_angle: Some(5.0), ..WeightRule::default() };
        let found = weights(&[rule.clone(), later.clone(), angle]);
        assert_eq!(found.length, [2.0, 7.0, 7.0, 9.0, 7.0, 7.0]);
        assert_eq!(found.angle, [2.0, 2.0, 2.0, 5.0, 5.0, 2.0]);
        assert_eq!(found.largest(), (9.0, 5.0));
        assert_eq!(weights(&[later, rule]).length[3], 7.0);
    }

    #[test]
    fn unknown_parts_are_named_with_their_range() {
        let tree = fork();
        let message = |rule: WeightRule| {
            let rule = WeightRule { w_angle: Some(1.0), ..rule };
            let params = Params { weights: vec![rule], ..Params::default() };
            check(&tree, &tree.branches(), &params).map(|report| report.warnings)
        };
        let of = |rule: WeightRule| message(rule).expect_err("refused").to_string();
        let rule = WeightRule::default;
        assert_eq!(
            of(WeightRule { branches: Some(vec![1, 3]), ..rule() }),
            "weights[0].branches: there is no 3: they are 0 to 2"
        );
        assert_eq!(
            of(WeightRule { nodes: Some(vec![0]), ..rule() }),
            "weights[0].nodes: there is no 0: they are 1 to 5"
        );
        let warnings = message(WeightRule { generations: Some([7, 9]), ..rule() }).expect("no error");
        assert_eq!(
            warnings[0].message,
            "embed.weights[0] selects nothing; the tree has generations 0 to 1 and is 4.000 mm deep"
        );
        assert!(message(WeightRule { generations: Some([1, 9]), ..rule() }).expect("no error").is_empty());
        let point = tree_of(&[(0.0, 0.0, 0.0, None)]);
        let params = Params {
            weights: vec![WeightRule { nodes: Some(vec![0]), w_angle: Some(1.0), ..rule() }],
            ..Params::default()
        };
        let error = check(&point, &point.branches(), &params).expect_err("refused").to_string();
        assert!(error.contains("single node"), "{error}");
        assert_eq!(Weights::new(&point, &point.branches(), &params).largest(), (2.0, 2.0));
    }
}
