//! The calibre on the way from the root to a place, of a run that is done: as a table, or as a plot.
//!
//! **Input** a run folder, a place. **Output** the rows of `profiles.tsv` on the way, each node once, with its point; or a
//! picture of them, where the user says.
//! **Guarantees** nothing in the run folder is changed; files that are not what the run wrote are refused.
//! **Cost** O(nodes).

mod plot;

use std::path::Path;

use espalier_model::anatomy::{PROFILE_COLUMNS, ProfileRow};
use espalier_model::table::{Table, significant};
use espalier_model::{FileError, Tree, swc};
use glam::DVec3;

use crate::error::Error;
use crate::folder::RunFolder;
use crate::stage::Artifact;

pub use plot::{PlotRequest, Plotted, plot_profile};

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
    let way = Way::read(&RunFolder::to_read(folder), way_to)?;
    let columns: Vec<&str> = PROFILE_COLUMNS.iter().map(|column| column.name).chain(PLACE_COLUMNS).collect();
    let mut table = Table::new(&columns);
    for row in &way.rows {
        let place = way.tree.position_mm(row.node).to_array().map(|value| significant(value, DIGITS));
        table.row_of(&row.cells.iter().cloned().chain(place).collect::<Vec<_>>());
    }
    Ok(table.into_string())
}

/// A way from the root, as the tables have it.
struct Way {
    tree: Tree,
    /// The node where it ends.
    end: usize,
    rows: Vec<Row>,
}

/// A row of `profiles.tsv`.
#[derive(Debug)]
struct Row {
    branch: usize,
    node: usize,
    cells: Vec<String>,
}

impl Row {
    /// The numbers of the row.
    fn values(&self) -> ProfileRow {
        let number = |cell: usize| self.cells[cell].parse().unwrap_or(f64::NAN);
        ProfileRow {
            branch: self.branch,
            node: self.node,
            from_start_mm: number(2),
            from_root_mm: number(3),
            radius_mm: number(4),
            area_radius_mm: number(5),
            reference_radius_mm: number(6),
            narrowing_percent: number(7),
        }
    }
}

impl Way {
    /// Reads a way of a run, every file checked against the folder's digests.
    fn read(run: &RunFolder, way_to: WayTo) -> Result<Self, Error> {
        let text = |file: &str| -> Result<String, Error> {
            Ok(String::from_utf8_lossy(&run.read(file)?).into_owned())
        };
        let (tree_file, at) = (Artifact::Tree.file(), |file: &str| run.path().join(file));
        let tree = swc::read_tree(&text(tree_file)?).map_err(|error| Error::file(&at(tree_file), error))?;
        let end = end_of(&tree, way_to)?;
        let rows =
            rows_to(&tree, end, &text(PROFILES)?).map_err(|error| Error::file(&at(PROFILES), error))?;
        Ok(Self { tree, end, rows })
    }
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
fn rows_to(tree: &Tree, end: usize, profiles: &str) -> Result<Vec<Row>, FileError> {
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
    let mut rows = Vec::new();
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
            rows.push(Row { branch, node, cells: cells.iter().map(|cell| (*cell).to_owned()).collect() });
        }
    }
    Ok(rows)
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
            let rows = rows_to(&tree, end, &profiles).expect("rows");
            rows.iter().map(|row| row.values().node).collect()
        };
        assert_eq!(way(WayTo::Node(4)), [0, 1, 3, 4]);
        assert_eq!(way(WayTo::Branch(1)), [0, 1, 2]);
        assert_eq!(way(WayTo::Point(DVec3::new(-9.0, 1.0, 0.0))), [0, 5]);
        assert_eq!(way(WayTo::Node(0)), [0]);
        assert!(matches!(end_of(&tree, WayTo::Node(6)), Err(Error::NoSuchPlace { n_there: 6, .. })));
        assert!(rows_to(&tree, 4, "header\n0\t99\n").is_err());
    }
}
