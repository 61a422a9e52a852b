//! A tree with its measures as VTK XML polydata, `.vtp`: for ParaView, 3D Slicer, VMTK.
//!
//! **Input** a tree and what was measured on it. **Output** the bytes of a file.
//! **Format** `espalier-vtp` version 1. One point for each node, in the order of `nodes.tsv`; one polyline for each
//! branch, from the fork or root that it starts from. Point arrays `radius_mm`, `MaximumInscribedSphereRadius` (the same
//! by the name that VMTK reads), `node`, `branch`, `generation`, `strahler`, `from_root_mm`, where whole numbers that do
//! not exist are −1; the cell arrays, if the tree was measured, are the columns of `branches.tsv` that are numbers, `NaN` where there is none.
//! **Spaces** LPS+ mm, as 3D Slicer and ITK hold meshes in files, stated in the field data `SPACE`, where Slicer looks
//! for it, and in a comment. x and y are those of our tables with the other sign.
//! **Guarantees** little-endian binary, without compression or time: the same tree gives the same bytes.
//! **Source** the VTK file formats, "XML file formats"; `vtkMRMLModelStorageNode` of 3D Slicer for `SPACE`.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use glam::DVec3;

use crate::anatomy::{MeasureValue, branch_measures};
use crate::{Anatomy, RAS_FROM_LPS, Tree};

/// The text of `tree.vtp`.
#[must_use]
pub fn write(tree: &Tree, anatomy: &Anatomy) -> String {
    let mut text = String::from("<?xml version=\"1.0\"?>\n");
    text += "<!-- espalier-vtp 1; SPACE=LPS; mm -->\n";
    text += "<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<PolyData>\n";
    text += "<FieldData>\n<Array type=\"String\" Name=\"SPACE\" NumberOfTuples=\"1\" format=\"ascii\">76 80 83 0</Array>\n</FieldData>\n";
    let (n_points, n_lines) = (tree.n_nodes(), tree.branches().list().len());
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "<Piece NumberOfPoints=\"{n_points}\" NumberOfVerts=\"0\" NumberOfLines=\"{n_lines}\" NumberOfStrips=\"0\" NumberOfPolys=\"0\">"
    );
    text += &point_data(tree);
    if anatomy.branches.len() == n_lines {
        text += &cell_data(anatomy);
    }
    text += &points(tree);
    text += &lines(tree);
    text += "</Piece>\n</PolyData>\n</VTKFile>\n";
    text
}

fn point_data(tree: &Tree) -> String {
    let branches = tree.branches();
    let of_branch = |value: &dyn Fn(usize) -> i32| {
        whole((0..tree.n_nodes()).map(|node| branches.of_node(node).map_or(-1, value)))
    };
    let mut from_root_mm = vec![0.0; tree.n_nodes()];
    for (node, parent) in tree.edges() {
        from_root_mm[node] = from_root_mm[parent] + tree.edge_length_mm(node);
    }
    let radii = numbers(tree.nodes().iter().map(|node| node.radius_mm));
    let mut text = String::from("<PointData Scalars=\"radius_mm\">\n");
    text += &array("Float64", "radius_mm", &radii);
    text += &array("Float64", "MaximumInscribedSphereRadius", &radii);
    text += &array("Int32", "node", &whole((0..tree.n_nodes()).map(|node| node as i32)));
    text += &array("Int32", "branch", &of_branch(&|branch| branch as i32));
    text += &array("Int32", "generation", &of_branch(&|branch| branches.list()[branch].generation as i32));
    text += &array("Int32", "strahler", &of_branch(&|branch| branches.list()[branch].strahler as i32));
    text += &array("Float64", "from_root_mm", &numbers(from_root_mm.into_iter()));
    text + "</PointData>\n"
}

fn cell_data(anatomy: &Anatomy) -> String {
    let mut text = String::from("<CellData Scalars=\"branch\">\n");
    for measure in branch_measures() {
        let values: Vec<MeasureValue> = anatomy.branches.iter().map(measure.of).collect();
        let as_whole = |value: &MeasureValue| match value {
            MeasureValue::Whole(whole) => Some(whole.map_or(-1, |whole| whole as i32)),
            _ => None,
        };
        let as_number = |value: &MeasureValue| match value {
            MeasureValue::Number(number) => Some(*number),
            _ => None,
        };
        // A measure has one kind for all branches.
        if let Some(values) = values.iter().map(as_whole).collect::<Option<Vec<i32>>>() {
            text += &array("Int32", measure.column.name, &whole(values.into_iter()));
        } else if let Some(values) = values.iter().map(as_number).collect::<Option<Vec<f64>>>() {
            text += &array("Float64", measure.column.name, &numbers(values.into_iter()));
        }
    }
    text + "</CellData>\n"
}

fn points(tree: &Tree) -> String {
    let lps = tree.nodes().iter().flat_map(|node| {
        // Adding 0 leaves it one sign only.
        (node.position_mm * RAS_FROM_LPS + DVec3::ZERO).to_array()
    });
    let bytes = encoded(lps.flat_map(f64::to_le_bytes));
    format!(
        "<Points>\n<DataArray type=\"Float64\" Name=\"Points\" NumberOfComponents=\"3\" format=\"binary\">{bytes}</DataArray>\n</Points>\n"
    )
}

fn lines(tree: &Tree) -> String {
    let branches = tree.branches();
    let (mut connectivity, mut offsets) = (Vec::new(), Vec::new());
    for branch in branches.list() {
        connectivity.extend(branch.polyline().map(|node| node as i64));
        offsets.push(connectivity.len() as i64);
    }
    let whole = |values: Vec<i64>| encoded(values.into_iter().flat_map(i64::to_le_bytes));
    let (connectivity, offsets) =
        (array("Int64", "connectivity", &whole(connectivity)), array("Int64", "offsets", &whole(offsets)));
    format!("<Lines>\n{connectivity}{offsets}</Lines>\n")
}

fn numbers(values: impl Iterator<Item = f64>) -> String {
    encoded(values.flat_map(f64::to_le_bytes))
}

fn whole(values: impl Iterator<Item = i32>) -> String {
    encoded(values.flat_map(i32::to_le_bytes))
}

/// Bytes behind their number, in base 64: what VTK calls binary.
fn encoded(bytes: impl Iterator<Item = u8>) -> String {
    let mut block = vec![0_u8; 8];
    block.extend(bytes);
    let n_bytes = block.len() as u64 - 8;
    block[..8].copy_from_slice(&n_bytes.to_le_bytes());
    BASE64_STANDARD.encode(block)
}

fn array(scalar: &str, name: &str, encoded: &str) -> String {
    format!("<DataArray type=\"{scalar}\" Name=\"{name}\" format=\"binary\">{encoded}</DataArray>\n")
}

#[cfg(test)]
mod tests {

    use super::*;
    use crate::Node;

    #[test]
    fn our_reader_reads_it_back() {
        let node = |x: f64, parent| Node {
            position_mm: DVec3::new(x, -0.1, 1.0 / 3.0),
            radius_mm: 0.25 + x,
            parent,
            kind: 0,
        };
        let tree = Tree::new(&[node(0.0, None), node(1.5, Some(0)), node(7.0, Some(1)), node(9.0, Some(1))])
            .expect("a tree");
        let text = write(&tree, &Anatomy::default());
        let scale = crate::swc::SwcScale::millimetres();
        // It names its space: none has to be assumed.
        let (read, _) = crate::polydata::parse(text.as_bytes(), &scale, None, 1 << 30).expect("polylines");
        for (node, data) in tree.nodes().iter().enumerate() {
            assert_eq!((read.points_mm[node], read.radii_mm[node]), (data.position_mm, data.radius_mm));
        }
        assert_eq!(read.lines.len(), tree.branches().list().len());
    }

    #[test]
    fn what_is_written_can_be_read() {
        let node = |x: f64, y: f64, parent| Node {
            position_mm: DVec3::new(x, y, 7.0),
            radius_mm: 0.5,
            parent,
            kind: 0,
        };
        let tree = Tree::new(&[
            node(0.0, 0.0, None),
            node(1.0, 0.0, Some(0)),
            node(2.0, 1.0, Some(1)),
            node(2.0, -1.0, Some(1)),
        ])
        .expect("a tree");
        let text = write(&tree, &Anatomy::default());
        let xml = roxmltree::Document::parse(&text).expect("XML");
        let values = |name: &str| -> Vec<u8> {
            let array = xml.descendants().find(|tag| tag.attribute("Name") == Some(name)).expect(name);
            let bytes = BASE64_STANDARD.decode(array.text().expect("text")).expect("base 64");
            let n_bytes = u64::from_le_bytes(bytes[..8].try_into().expect("8 bytes")) as usize;
            assert_eq!(n_bytes, bytes.len() - 8, "{name}");
            bytes[8..].to_vec()
        };
        let whole = |name: &str| -> Vec<i64> {
            values(name).chunks_exact(8).map(|b| i64::from_le_bytes(b.try_into().expect("8 bytes"))).collect()
        };
        assert_eq!(whole("connectivity"), [0, 1, 1, 2, 1, 3]);
        assert_eq!(whole("offsets"), [2, 4, 6]);
        let points: Vec<f64> = values("Points")
            .chunks_exact(8)
            .map(|b| f64::from_le_bytes(b.try_into().expect("8 bytes")))
            .collect();
        assert_eq!(points[6..9], [-2.0, -1.0, 7.0]);
        assert_eq!(values("MaximumInscribedSphereRadius"), values("radius_mm"));
        assert_eq!(values("branch")[..8], [255, 255, 255, 255, 0, 0, 0, 0]);
    }
}
