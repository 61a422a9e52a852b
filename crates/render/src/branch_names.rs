//! Which of a few colours each branch has, the same in every picture and table of a tree.
//!
//! **Input** the branches. **Output** for each the index of one of `n_colors` colours.
//! **Steps** from the root outwards, generation by generation: of all colours, the one that its nearest relatives have
//! least. A parent or a sibling of the colour weighs more than any number of grandparents and siblings of the parent;
//! of equals, the one whose turn it is.
//! **Guarantees** a branch differs from its parent and, with at most `n_colors` − 1 of them, from its siblings. Colours
//! depend on the tree alone: not on the picture, its theme or its view.
//! **Cost** O(branches · colours + branches · log branches).

use espalier_model::{Branches, Tree};

use crate::palette::{Palette, to_byte};

/// What a relative of the same colour costs: parent, sibling, grandparent, sibling of the parent.
const COSTS: [u64; 4] = [1 << 40, 1 << 20, 2, 2];

/// The colour of each branch, sRGB, as in every picture that is coloured by branch.
#[must_use]
pub fn branch_colors(tree: &Tree) -> Vec<[u8; 3]> {
    let palette = Palette::names();
    let names = names(&tree.branches(), palette.len());
    names.into_iter().map(|name| palette.at(palette.value_of(name)).map(to_byte)).collect()
}

/// The index of each branch's colour.
pub(crate) fn names(branches: &Branches, n_colors: usize) -> Vec<usize> {
    let list = branches.list();
    let mut order: Vec<usize> = (0..list.len()).collect();
    order.sort_by_key(|&branch| (list[branch].generation, branch));
    let mut names = vec![0; list.len()];
    // By parent, the last entry for what hangs from the root: how many of its children have each colour so far.
    let mut children = vec![0_u32; (list.len() + 1) * n_colors];
    let family = |parent: Option<usize>| parent.unwrap_or(list.len()) * n_colors;
    for branch in order {
        let parent = list[branch].parent;
        let grandparent = parent.and_then(|parent| list[parent].parent);
        let cost = |name: usize| -> u64 {
            let is_of =
                |relative: Option<usize>| u64::from(relative.is_some_and(|other| names[other] == name));
            let siblings = u64::from(children[family(parent) + name]);
            let uncles = parent.map_or(0, |_| u64::from(children[family(grandparent) + name]));
            let counts = [is_of(parent), siblings, is_of(grandparent), uncles];
            counts.into_iter().zip(COSTS).map(|(count, cost)| count * cost).sum()
        };
        let turns = (0..n_colors).map(|step| (branch + step) % n_colors);
        let name = turns.min_by_key(|&name| cost(name)).unwrap_or(0);
        names[branch] = name;
        children[family(parent) + name] += 1;
    }
    names
}

#[cfg(test)]
mod tests {
    use espalier_model::Node;
    use glam::DVec3;

    use super::*;

    /// A tree of nodes with these parents, one after the other.
    fn tree_of(parents: &[usize]) -> Tree {
        let node = |(i, parent): (usize, Option<usize>)| Node {
            position_mm: DVec3::new(i as f64, (i * i % 7) as f64, 0.0),
            radius_mm: 1.0,
            parent,
            kind: 0,
        };
        let parents = std::iter::once(None).chain(parents.iter().copied().map(Some));
        Tree::new(&parents.enumerate().map(node).collect::<Vec<_>>()).expect("a tree")
    }

    #[test]
    fn relatives_differ() {
        // A binary tree of six generations.
        let binary: Vec<usize> = (1..127).map(|i| (i - 1) / 2).collect();
        let branches = tree_of(&binary).branches();
        let names = names(&branches, 6);
        let list = branches.list();
        for (a, branch) in list.iter().enumerate() {
            let Some(parent) = branch.parent else { continue };
            assert_ne!(names[a], names[parent]);
            let grandparent = list[parent].parent;
            assert!(grandparent.is_none_or(|grandparent| names[grandparent] != names[a]));
            for (b, other) in list.iter().enumerate() {
                let is_sibling = other.parent == branch.parent;
                let is_uncle = other.parent == grandparent && b != parent;
                assert!(a == b || !(is_sibling || is_uncle) || names[a] != names[b], "{a} {b}");
            }
        }
        assert!((0..6).all(|name| names.contains(&name)));
    }

    #[test]
    fn a_star_takes_all_colours_in_turn() {
        let branches = tree_of(&[0; 600]).branches();
        let names = names(&branches, 6);
        assert!((0..6).all(|name| names.iter().filter(|&&other| other == name).count() == 100));
    }
}
