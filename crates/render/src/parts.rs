//! The main subtrees of a tree, each in a colour of its own, to be found again in other pictures of it.
//!
//! **Input** a tree. **Output** its colours: grey for the stems, six colours for the parts, in preorder.
//! **Steps** begin with the branches at the root. While there are fewer parts than colours, divide the longest part at
//! the fork where its first branch ends: the branch becomes stem, its children parts. Children under a twenty-fifth of
//! the whole stay stem. A part whose division would make more than a quarter of the whole stem is left as it is.
//! **Guarantees** the same parts for the same tree, whatever is drawn of it. More parts than colours (a star) take the
//! colours in turn.
//! **Cost** O(branches · colours).

use espalier_model::{Branches, Tree};

use crate::coloring::Coloring;
use crate::palette::Palette;
use crate::params::Theme;

/// Smaller parts stay stem, as a share of the tree's length.
const LEAST_PART: f64 = 0.04;
/// The most that may be stem.
const MOST_STEM: f64 = 0.25;

/// Colours the main subtrees.
pub(crate) fn color(tree: &Tree, branches: &Branches, theme: Theme) -> Coloring {
    let palette = Palette::parts(theme);
    let mut ends = vec![[palette.value_of(0); 2]; tree.n_nodes()];
    let n_colors = palette.len() - 1;
    for (part_idx, branch) in parts(tree, branches, n_colors).into_iter().enumerate() {
        let value = palette.value_of(1 + part_idx % n_colors);
        ends[subtree(tree, branches, branch)].fill([value; 2]);
    }
    Coloring { palette, ends, scale: None }
}

/// The nodes of a branch and of all that hangs from it.
fn subtree(tree: &Tree, branches: &Branches, branch: usize) -> std::ops::Range<usize> {
    tree.subtree(branches.list()[branch].nodes.start)
}

/// The first branches of the parts, in preorder.
fn parts(tree: &Tree, branches: &Branches, n_wanted: usize) -> Vec<usize> {
    let list = branches.list();
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); list.len()];
    let mut parts = Vec::new();
    for (branch_idx, branch) in list.iter().enumerate() {
        branch.parent.map_or(&mut parts, |parent| &mut children[parent]).push(branch_idx);
    }
    let length_mm = |branch: usize| -> f64 {
        subtree(tree, branches, branch).map(|node| tree.edge_length_mm(node)).sum()
    };
    let (mut lengths_mm, mut total_mm) = (vec![0.0; list.len()], 0.0);
    for &part in &parts {
        total_mm += length_mm(part);
    }
    for (branch_idx, branch) in list.iter().enumerate().rev() {
        lengths_mm[branch_idx] += branches.length_mm(tree, branch_idx);
        if let Some(parent) = branch.parent {
            let own_mm = lengths_mm[branch_idx];
            lengths_mm[parent] += own_mm;
        }
    }

    let mut stem_mm = 0.0;
    let mut is_whole = vec![false; list.len()];
    while parts.len() < n_wanted {
        let divisible = parts.iter().enumerate().filter(|&(_, &part)| !is_whole[part]);
        let longest =
            divisible.max_by(|a, b| lengths_mm[*a.1].total_cmp(&lengths_mm[*b.1]).then(b.0.cmp(&a.0)));
        let Some((place, &part)) = longest else { break };
        let is_large = |&child: &usize| lengths_mm[child] >= LEAST_PART * total_mm;
        let large: Vec<usize> = children[part].iter().copied().filter(is_large).collect();
        let left_mm = lengths_mm[part] - large.iter().map(|&child| lengths_mm[child]).sum::<f64>();
        if large.is_empty() || stem_mm + left_mm > MOST_STEM * total_mm {
            is_whole[part] = true;
            continue;
        }
        stem_mm += left_mm;
        parts.swap_remove(place);
        parts.extend(large);
    }
    parts.sort_unstable();
    parts
}

#[cfg(test)]
mod tests {
    use espalier_model::Node;
    use glam::DVec3;

    use super::*;

    fn tree_of(nodes: &[(f64, f64, Option<usize>)]) -> Tree {
        let node = |&(x, y, parent): &(f64, f64, Option<usize>)| Node {
            position_mm: DVec3::new(x, y, 0.0),
            radius_mm: 1.0,
            parent,
            kind: 0,
        };
        Tree::new(&nodes.iter().map(node).collect::<Vec<_>>()).expect("a tree")
    }

    #[test]
    fn a_stem_and_its_arms() {
        // A stem of 1, arms of 10 and 5, a twig of 0.2.
        let tree = tree_of(&[
            (0.0, 0.0, None),
            (0.0, 1.0, Some(0)),
            (10.0, 1.0, Some(1)),
            (-5.0, 1.0, Some(1)),
            (0.0, 1.2, Some(1)),
        ]);
        let coloring = color(&tree, &tree.branches(), Theme::Light);
        let grey = coloring.palette.value_of(0);
        let [stem, arm, other, twig] = [1, 2, 3, 4].map(|node: usize| coloring.ends[node][0]);
        assert_eq!([stem, twig], [grey; 2]);
        assert!(arm != grey && other != grey && arm != other);
    }

    #[test]
    fn a_star_a_comb_and_a_point_have_colours() {
        let mut star = vec![(0.0, 0.0, None)];
        star.extend((0..1000).map(|i| (f64::from(i) + 1.0, 1.0, Some(0))));
        let mut comb = vec![(0.0, 0.0, None)];
        for tooth in 0..2000 {
            let spine = comb.len() - 1;
            let spine = if tooth == 0 { 0 } else { spine - 1 };
            comb.push((f64::from(tooth) + 1.0, 0.0, Some(spine)));
            comb.push((f64::from(tooth) + 1.0, 1.0, Some(comb.len() - 1)));
        }
        for nodes in [star, comb, vec![(0.0, 0.0, None)]] {
            let tree = tree_of(&nodes);
            let coloring = color(&tree, &tree.branches(), Theme::Dark);
            assert_eq!(coloring.ends.len(), tree.n_nodes());
            let n_grey = coloring.ends.iter().filter(|ends| ends[0] == coloring.palette.value_of(0)).count();
            assert!(n_grey <= tree.n_nodes() / 2 + 1, "{n_grey} of {}", tree.n_nodes());
        }
    }
}
