//! A tree as a graph, `.graphml`: for networkx, igraph, Gephi, Cytoscape.
//!
//! **Input** a tree and what was measured on it. **Output** the text of a file.
//! **Format** a directed graph: root, forks and tips are its nodes, with the node's number in `nodes.tsv` as id behind an
//! `n`; branches are its edges, from the root outwards, with the columns of `branches.tsv` as data. What does not exist
//! is left out. **Spaces** RAS+ mm, stated in the graph's data `space`.
//! **Guarantees** the same tree gives the same bytes; numbers read back as the same `f64`.
//! **Source** the GraphML primer of graphdrawing.org.

use std::fmt::Write as _;

use crate::anatomy::{MeasureValue, branch_measures};
use crate::xml::escape;
use crate::{Anatomy, Tree};

const HEAD: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>
<graphml xmlns=\"http://graphml.graphdrawing.org/xmlns\">
<key id=\"format\" for=\"graph\" attr.name=\"format\" attr.type=\"string\"/>
<key id=\"space\" for=\"graph\" attr.name=\"space\" attr.type=\"string\"/>
<key id=\"node_kind\" for=\"node\" attr.name=\"kind\" attr.type=\"string\"/>
<key id=\"node_x_mm\" for=\"node\" attr.name=\"x_mm\" attr.type=\"double\"/>
<key id=\"node_y_mm\" for=\"node\" attr.name=\"y_mm\" attr.type=\"double\"/>
<key id=\"node_z_mm\" for=\"node\" attr.name=\"z_mm\" attr.type=\"double\"/>
<key id=\"node_radius_mm\" for=\"node\" attr.name=\"radius_mm\" attr.type=\"double\"/>
";

/// The text of `tree.graphml`.
#[must_use]
pub fn write(tree: &Tree, anatomy: &Anatomy) -> String {
    let mut text = HEAD.to_owned();
    for measure in branch_measures() {
        let name = measure.column.name;
        let kind = anatomy.branches.first().map_or("string", |branch| match (measure.of)(branch) {
            MeasureValue::Whole(_) => "int",
            MeasureValue::Number(_) => "double",
            MeasureValue::Text(_) => "string",
        });
        // Writing to a string cannot fail.
        let _ = writeln!(text, "<key id=\"{name}\" for=\"edge\" attr.name=\"{name}\" attr.type=\"{kind}\"/>");
    }
    text += "<graph id=\"tree\" edgedefault=\"directed\">\n";
    text += "<data key=\"format\">espalier-graphml 1</data>\n<data key=\"space\">RAS</data>\n";
    let ends = anatomy.branches.iter().map(|branch| branch.end_node);
    std::iter::once(0).chain(ends).for_each(|node| write_node(&mut text, tree, node));
    for branch in &anatomy.branches {
        let (from, to) = (branch.start_node, branch.end_node);
        let _ = writeln!(text, "<edge id=\"b{}\" source=\"n{from}\" target=\"n{to}\">", branch.branch);
        for measure in branch_measures() {
            write_data(&mut text, measure.column.name, &(measure.of)(branch));
        }
        text += "</edge>\n";
    }
    text + "</graph>\n</graphml>\n"
}

fn write_node(text: &mut String, tree: &Tree, node: usize) {
    let kind = match (node, tree.children(node).len()) {
        (0, _) => "root",
        (_, 0) => "tip",
        _ => "fork",
    };
    let data = &tree.nodes()[node];
    let [x, y, z] = data.position_mm.to_array();
    let _ = writeln!(text, "<node id=\"n{node}\">\n<data key=\"node_kind\">{kind}</data>");
    for (key, value) in [("x_mm", x), ("y_mm", y), ("z_mm", z), ("radius_mm", data.radius_mm)] {
        let _ = writeln!(text, "<data key=\"node_{key}\">{value}</data>");
    }
    text.push_str("</node>\n");
}

fn write_data(text: &mut String, name: &str, value: &MeasureValue) {
    let value = match value {
        MeasureValue::Whole(whole) => whole.map(|whole| whole.to_string()),
        MeasureValue::Number(number) => (!number.is_nan()).then(|| number.to_string()),
        MeasureValue::Text(words) => (!words.is_empty()).then(|| escape(words)),
    };
    if let Some(value) = value {
        let _ = writeln!(text, "<data key=\"{name}\">{value}</data>");
    }
}
