//! Polylines of VTK files become trees: VMTK's centrelines, every encoding, hostile bytes.
#![allow(clippy::expect_used, clippy::panic, clippy::print_stdout, reason = "this is how a test speaks")]
#![allow(clippy::disallowed_methods, reason = "tests find their data through the environment")]

use std::path::PathBuf;

use espalier_geom::random::{Purpose, Stream};
use espalier_model::Diagnose;
use espalier_model::polydata::{Polylines, is_polydata, parse};
use espalier_model::swc::{SwcScale, Traced};
use espalier_tree::join_lines;
use glam::DVec3;

fn read(bytes: &[u8]) -> Result<Polylines, String> {
    parse(bytes, &SwcScale::millimetres(), Some(DVec3::ONE), 1 << 30)
        .map(|(lines, _)| lines)
        .map_err(|error| error.code().to_owned())
}

fn n_of_degree(traced: &Traced, degree: usize) -> usize {
    let mut n_children = vec![0; traced.nodes.len()];
    traced.nodes.iter().filter_map(|node| node.parent).for_each(|parent| n_children[parent] += 1);
    n_children.iter().filter(|&&n| n == degree).count()
}

fn length_mm(traced: &Traced) -> f64 {
    let edge = |node: &espalier_model::swc::TracedNode| {
        node.parent.map_or(0.0, |parent| node.position_mm.distance(traced.nodes[parent].position_mm))
    };
    traced.nodes.iter().map(edge).sum()
}

/// One inlet, two outlets: each file of the same two centrelines gives one fork and the same trunk, whether the lines
/// are whole or in pieces, resampled, or smoothed.
#[test]
fn centrelines_of_an_aorta_are_one_tree() {
    let Some(data) = std::env::var_os("ESPALIER_DATA").map(PathBuf::from) else {
        println!("skipped: ESPALIER_DATA not set");
        return;
    };
    let folder = data.join("reference/vmtk");
    let mut n_files = 0;
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.extension().is_none_or(|extension| extension != "vtp") {
            continue;
        }
        let name = path.display();
        let lines =
            read(&std::fs::read(&path).expect("readable")).unwrap_or_else(|code| panic!("{name}: {code}"));
        assert!(lines.radii_mm.iter().all(|&radius| radius > 2.0 && radius < 9.0), "{name}");
        let (traced, report) = join_lines(&lines);
        assert!(report.warnings.is_empty(), "{name}: {:?}", report.warnings);
        let n_roots = traced.nodes.iter().filter(|node| node.parent.is_none()).count();
        assert_eq!((n_roots, n_of_degree(&traced, 2), n_of_degree(&traced, 0)), (1, 1, 2), "{name}");
        assert!(traced.nodes[0].position_mm.distance(DVec3::new(222.096, 175.87, 21.673)) < 1e-2, "{name}");
        // The trunk once and both legs: 122 mm, give or take what smoothing takes.
        let length = length_mm(&traced);
        assert!((110.0..125.0).contains(&length), "{name}: {length}");
        n_files += 1;
    }
    assert!(n_files >= 7, "{n_files}");
}

const XML: &str = r#"<?xml version="1.0"?>
<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64"><PolyData>
<FieldData><Array type="String" Name="SPACE" NumberOfTuples="1" format="ascii">76 80 83 0</Array></FieldData>
<Piece NumberOfPoints="5" NumberOfVerts="1" NumberOfLines="3" NumberOfStrips="0" NumberOfPolys="0">
<PointData><DataArray type="Float64" Name="radius_mm" format="ascii">1 1 0.5 0.5 0.25</DataArray></PointData>
<Points><DataArray type="Float32" NumberOfComponents="3" format="ascii">0 0 0 0 0 5 0 1 9 0 -1 9 2 2 2</DataArray></Points>
<Verts><DataArray type="Int64" Name="connectivity" format="ascii">4</DataArray><DataArray type="Int64" Name="offsets" format="ascii">1</DataArray></Verts>
<Lines><DataArray type="Int64" Name="connectivity" format="ascii">3 1 0 1 1 2</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">2 4 6</DataArray></Lines>
</Piece></PolyData></VTKFile>"#;

const LEGACY: &str = "# vtk DataFile Version 4.2\ncentrelines SPACE=LPS\nASCII\nDATASET POLYDATA\nPOINTS 5 float\n\
    0 0 0 0 0 5 0 1 9\n0 -1 9 2 2 2\nVERTICES 1 2\n1 4\nLINES 3 9\n2 3 1\n2 0 1\n2 1 2\nPOINT_DATA 5\n\
    FIELD FieldData 2\nother 2 5 int\n1 2 3 4 5 6 7 8 9 0\nMaximumInscribedSphereRadius 1 5 double\n1 1 0.5 0.5 0.25\n";

const LEGACY_5: &str = "# vtk DataFile Version 5.1\nx SPACE=LPS\nASCII\nDATASET POLYDATA\nPOINTS 5 double\n\
    0 0 0 0 0 5 0 1 9 0 -1 9 2 2 2\nMETADATA\nINFORMATION 0\n\nVERTICES 2 1\nOFFSETS vtktypeint64\n0 1\n\
    CONNECTIVITY vtktypeint64\n4\nLINES 4 6\nOFFSETS vtktypeint64\n0 2 4 6\nCONNECTIVITY vtktypeint64\n3 1 0 1 1 2\n\
    POINT_DATA 5\nSCALARS radius_mm double\nLOOKUP_TABLE default\n1 1 0.5 0.5 0.25\n";

/// Both formats, one tree; the lines are given from tips and root alike, in any order; LPS becomes RAS.
#[test]
fn xml_and_legacy_are_the_same_tree() {
    let expected = read(XML.as_bytes()).expect("XML");
    assert_eq!(expected.points_mm[2], DVec3::new(0.0, -1.0, 9.0));
    assert_eq!(expected.radii_mm, [1.0, 1.0, 0.5, 0.5, 0.25]);
    assert_eq!(read(LEGACY.as_bytes()).as_ref(), Ok(&expected));
    assert_eq!(read(LEGACY_5.as_bytes()).as_ref(), Ok(&expected));
    let (traced, _) = join_lines(&expected);
    assert_eq!((traced.nodes.len(), n_of_degree(&traced, 2), n_of_degree(&traced, 0)), (4, 1, 2));
}

/// The same five points and three lines, written by VTK 9 in each of its ways.
const BY_VTK: [&[u8]; 11] = [
    include_bytes!("vtk/ascii.vtp"),
    include_bytes!("vtk/binary.vtp"),
    include_bytes!("vtk/binary_zlib.vtp"),
    include_bytes!("vtk/appended_raw.vtp"),
    include_bytes!("vtk/appended_raw_zlib.vtp"),
    include_bytes!("vtk/appended_base64.vtp"),
    include_bytes!("vtk/appended_base64_zlib.vtp"),
    include_bytes!("vtk/legacy_ascii_42.vtk"),
    include_bytes!("vtk/legacy_binary_42.vtk"),
    include_bytes!("vtk/legacy_ascii_51.vtk"),
    include_bytes!("vtk/legacy_binary_51.vtk"),
];

#[test]
fn every_encoding_of_vtk() {
    let lps = Some(DVec3::new(-1.0, -1.0, 1.0));
    let expected = read(XML.as_bytes()).expect("XML");
    for (index, bytes) in BY_VTK.into_iter().enumerate() {
        assert!(is_polydata(bytes), "{index}");
        let parsed = parse(bytes, &SwcScale::millimetres(), lps, 1 << 30);
        let (lines, report) = parsed.unwrap_or_else(|error| panic!("{index}: {error}"));
        assert_eq!((&lines, report.warnings.len()), (&expected, 0), "{index}: {:?}", report.warnings);
    }
}

#[test]
fn what_is_wrong_has_a_name() {
    let code = |from: &str, to: &str| read(XML.replace(from, to).as_bytes()).expect_err("refused");
    assert_eq!(code("PolyData\"", "ImageData\""), "E-POLYDATA-UNKNOWN");
    assert_eq!(code("header_type", "compressor=\"vtkLZ4DataCompressor\" header_type"), "E-POLYDATA-UNKNOWN");
    assert_eq!(code("</Lines>", ""), "E-POLYDATA-XML");
    assert_eq!(code("NumberOfLines=\"3\"", "NumberOfLines=\"0\""), "E-POLYDATA-NO-LINES");
    assert_eq!(code("NumberOfPoints=\"5\"", "NumberOfPoints=\"99999999999999999\""), "E-POLYDATA-WORD");
    assert_eq!(code("NumberOfPoints=\"5\"", "NumberOfPoints=\"6\""), "E-POLYDATA-COUNT");
    assert_eq!(code("3 1 0 1 1 2", "3 1 0 1 1 7"), "E-POLYDATA-MISSING-POINT");
    assert_eq!(code("3 1 0 1 1 2", "3 1 0 1 1 -1"), "E-POLYDATA-MISSING-POINT");
    assert_eq!(code("2 4 6", "4 2 6"), "E-POLYDATA-WORD");
    assert_eq!(code("0 0 5", "0 0 nan"), "E-POLYDATA-POINT");
    assert_eq!(code("format=\"ascii\">3 1", "format=\"binary\">3 1"), "E-POLYDATA-BYTES");
    let unplaced = XML.replace("76 80 83 0", "");
    let error = parse(unplaced.as_bytes(), &SwcScale::millimetres(), None, 1 << 30).expect_err("no space");
    assert_eq!((error.code(), error.class().exit_code()), ("E-POLYDATA-NO-SPACE", 3));
    assert!(error.hint().contains("input.assume_space"), "{}", error.hint());
}

/// Trunks that are close but not the same points are one trunk; lines that cross it elsewhere are not.
#[test]
fn lines_follow_a_common_trunk() {
    let mut points_mm = Vec::new();
    let mut lines = Vec::new();
    for (line, bend) in [0.0, 1.0, -1.0].into_iter().enumerate() {
        let first = points_mm.len();
        // Steps of another length for each line; they part at z = 10.
        let step = 0.5 + 0.11 * line as f64;
        points_mm.extend((0..40).map(|i| {
            let z = step * f64::from(i);
            DVec3::new((z - 10.0).max(0.0) * bend, 0.0, z)
        }));
        lines.push(espalier_model::polydata::Polyline { points: (first..first + 40).collect(), tract: None });
    }
    let radii_mm = vec![1.0; points_mm.len()];
    let (traced, _) = join_lines(&Polylines { points_mm, radii_mm, lines });
    assert_eq!(
        (n_of_degree(&traced, 0), n_of_degree(&traced, 1) + n_of_degree(&traced, 2)),
        (3, traced.nodes.len() - 3)
    );
    let fork =
        |node: &espalier_model::swc::TracedNode| node.position_mm.x != 0.0 || node.position_mm.z < 20.0;
    assert!(traced.nodes.iter().all(fork));
}

#[test]
fn mutants_never_panic() {
    let mut stream = Stream::new(23, Purpose::Test, 0, 0);
    let (mut n_read, mut n_refused) = (0, 0);
    let texts = [XML, LEGACY, LEGACY_5].map(str::as_bytes);
    for original in texts.into_iter().chain(BY_VTK) {
        for _ in 0..500 {
            let mut bytes = original.to_vec();
            for _ in 0..1 + stream.below(3) {
                let at = stream.below(bytes.len() as u32) as usize;
                match stream.below(5) {
                    0 => bytes.truncate(at.max(30)),
                    1 => drop(bytes.drain(at..(at + 4).min(bytes.len()))),
                    2 => bytes[at] = b'9',
                    3 => bytes.insert(at, b'9'),
                    _ => bytes[at] = stream.next_u32() as u8,
                }
            }
            match read(&bytes) {
                Ok(lines) => {
                    let _ = join_lines(&lines);
                    n_read += 1;
                }
                Err(_) => n_refused += 1,
            }
        }
    }
    assert!(n_read > 300 && n_refused > 300, "{n_read} read, {n_refused} refused");
}
