//! The calibre on the way from the root to a place, of a run that is done.
//!
//! **Input** a run folder, a place. **Output** the rows of `profiles.tsv` on the way, each node once, with its point.
//! **Guarantees** nothing is written; files that are not what the run wrote are refused.
//! **Cost** O(nodes).

use std::path::Path;

use espalier_model::anatomy::PROFILE_COLUMNS;
use espalier_model::table::{Table, significant};
use espalier_model::{FileError, Tree, swc};
use glam::DVec3;

use crate::error::Error;
use crate::folder::RunFolder;
use crate::stage::Artifact;

const PROFILES: &str = "profiles.tsv";
/// The columns that say where a row is, behind those of `profiles.tsv`.
const PLACE_COLUMNS: [&str; 3] = ["x_mm", "y_mm", "z_mm"];
/// As in the tables.
const DIGITS: usize = 7;

/// Where a way from the root leads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum WayTo {
    /// To a node, such as a tip.
    Node(usize),
    /// To the end of a branch.
    Branch(usize),
    /// To the node nearest to a point, RAS+ mm.
    Point(DVec3),
}

/// The table of the way from the root to a place.
///
/// # Errors
/// A folder without a tree or its profiles, files that were altered, a node or branch that the tree does not have.
pub fn profile(folder: &Path, way_to: WayTo) -> Result<String, Error> {
    let run = RunFolder::to_read(folder);
    let text =
        |file: &str| -> Result<String, Error> { Ok(String::from_utf8_lossy(&run.read(file)?).into_owned()) };
    let tree_file = Artifact::Tree.file();
    let tree =
        swc::read_tree(&text(tree_file)?).map_err(|error| Error::file(&folder.join(tree_file), error))?;
    let end = end_of(&tree, way_to)?;
    let rows = rows_to(&tree, end, &text(PROFILES)?);
    rows.map_err(|error| Error::file(&folder.join(PROFILES), error))
}

/// The node where the way ends.
fn end_of(tree: &Tree, way_to: WayTo) -> Result<usize, Error> {
    let branches = tree.branches();
    let within = |what, index: usize, n_there: usize| {
        if index < n_there { Ok(index) } else { Err(Error::NoSuchPlace { what, index, n_there }) }
    };
    match way_to {
        WayTo::Node(node) => within("node", node, tree.n_nodes()),
        WayTo::Branch(branch) => {
            within("branch", branch, branches.list().len()).map(|branch| branches.list()[branch].end())
        }
        WayTo::Point(point_mm) => {
            let distance = |node: &usize| tree.position_mm(*node).distance_squared(point_mm);
            Ok((0..tree.n_nodes()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0))
        }
    }
}

/// The rows on the way from the root to a node.
fn rows_to(tree: &Tree, end: usize, profiles: &str) -> Result<String, FileError> {
    let mut is_on_way = vec![false; tree.n_nodes()];
    let mut node = Some(end);
    while let Some(here) = node {
        is_on_way[here] = true;
        node = tree.parent(here);
    }
    let branches = tree.branches();
    let first = (1..tree.n_nodes()).find(|&node| is_on_way[node]).and_then(|node| branches.of_node(node));
    // The root stands in each branch from it; on no way at all, in the first.
    let first = first.or(Some(0));
    let columns: Vec<&str> = PROFILE_COLUMNS.iter().map(|column| column.name).chain(PLACE_COLUMNS).collect();
    let mut table = Table::new(&columns);
    for (line_idx, line) in profiles.lines().enumerate().skip(1) {
        let cells: Vec<&str> = line.split('\t').collect();
        let index = |cell: usize| cells.get(cell).and_then(|cell| cell.parse::<usize>().ok());
        let (branch, node) = match (index(0), index(1)) {
            (Some(branch), Some(node)) if cells.len() == PROFILE_COLUMNS.len() && node < tree.n_nodes() => {
                (branch, node)
            }
            _ => {
                let what = format!("line {} is no row of this tree's profiles: {line:.60}", line_idx + 1);
                return Err(FileError::Invalid { format: PROFILES, what });
            }
        };
        // A fork has a row in each branch that starts from it; on the way it is the end of the branch before.
        let is_own = branches.of_node(node).map_or(Some(branch) == first, |own| own == branch);
        if is_on_way[node] && is_own {
            let place = tree.position_mm(node).to_array().map(|value| significant(value, DIGITS));
            let cells: Vec<String> = cells.iter().map(|cell| (*cell).to_owned()).chain(place).collect();
            table.row_of(&cells);
        }
    }
    Ok(table.into_string())
}

#[cfg(test)]
mod tests {
    use espalier_model::Node;
    use espalier_tree::{MeasureContext, measure};

    use super::*;

    #[test]
    fn each_node_on_the_way_has_one_row() {
        let node = |x: f64, y: f64, parent| Node {
            position_mm: DVec3::new(x, y, 0.0),
            radius_mm: 0.5,
            parent,
            kind: 0,
        };
        let nodes = [
            node(0.0, 0.0, None),
            node(5.0, 0.0, Some(0)),
            node(9.0, 3.0, Some(1)),
            node(9.0, -3.0, Some(1)),
            node(9.0, -6.0, Some(3)),
            node(-4.0, 0.0, Some(0)),
        ];
        let tree = Tree::new(&nodes).expect("a tree");
        let profiles = measure(&tree, &MeasureContext::default()).profiles_tsv();
        let way = |to: WayTo| -> Vec<usize> {
            let end = end_of(&tree, to).expect("a place");
            let table = rows_to(&tree, end, &profiles).expect("rows");
            table
                .lines()
                .skip(1)
                .map(|line| line.split('\t').nth(1).expect("a node").parse().expect("a number"))
                .collect()
        };
        assert_eq!(way(WayTo::Node(4)), [0, 1, 3, 4]);
        assert_eq!(way(WayTo::Branch(1)), [0, 1, 2]);
        assert_eq!(way(WayTo::Point(DVec3::new(-9.0, 1.0, 0.0))), [0, 5]);
        assert_eq!(way(WayTo::Node(0)), [0]);
        assert!(matches!(end_of(&tree, WayTo::Node(6)), Err(Error::NoSuchPlace { n_there: 6, .. })));
        assert!(rows_to(&tree, 4, "header\n0\t99\n").is_err());
    }
}
