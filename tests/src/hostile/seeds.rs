//! Well-formed volumes and traced trees of every format, written here.
//!
//! **Output** seeds. A volume has 9x8x7 voxels of 16 bits; a tree is a few branches.

use flate2::read::GzDecoder;
use glam::DVec3;
use ndarray::Array3;
use std::io::Read as _;

use espalier_model::{Grid, Volume, Voxels, nifti_out};

use super::{Packing, Part, Seed, SeedFile};

const SHAPE: [usize; 3] = [9, 8, 7];

/// The voxels.
pub(super) fn values() -> Vec<i16> {
    (0..SHAPE.iter().product::<usize>() as i32).map(|i| (i * 37 % 1500 - 1000) as i16).collect()
}

fn raw(is_big_endian: bool) -> Vec<u8> {
    let bytes = |value: i16| if is_big_endian { value.to_be_bytes() } else { value.to_le_bytes() };
    values().into_iter().flat_map(bytes).collect()
}

/// The file that our writer makes, decompressed.
fn written() -> Vec<u8> {
    let spacing = DVec3::new(0.5, 0.5, 2.0);
    let grid = Grid::axis_aligned(SHAPE, spacing, DVec3::ZERO).ok();
    let array = Array3::from_shape_vec((SHAPE[2], SHAPE[1], SHAPE[0]), values()).ok();
    let volume = grid.zip(array).map(|(grid, array)| Volume::new(grid, Voxels::I16(array), 1.0, 0.0));
    let packed = volume.and_then(|volume| nifti_out::volume(&volume).ok()).unwrap_or_default();
    let mut plain = Vec::new();
    // From memory, of our own making.
    let _ = GzDecoder::new(packed.as_slice()).read_to_end(&mut plain);
    plain
}

/// Puts numbers into a header.
struct Header {
    bytes: Vec<u8>,
    is_big_endian: bool,
}

macro_rules! put {
    ($header:expr, $at:expr, $numbers:expr) => {
        for (i, number) in $numbers.into_iter().enumerate() {
            let bytes = if $header.is_big_endian { number.to_be_bytes() } else { number.to_le_bytes() };
            let at = $at + i * bytes.len();
            $header.bytes[at..at + bytes.len()].copy_from_slice(&bytes);
        }
    };
}

/// A header of NIfTI-1, of a file or of a pair.
pub(super) fn nifti_1(is_big_endian: bool, is_pair: bool) -> Vec<u8> {
    let mut header = Header { bytes: vec![0; if is_pair { 348 } else { 352 }], is_big_endian };
    put!(header, 0, [348_i32]);
    put!(header, 40, [3_i16, 9, 8, 7, 1, 1, 1, 1]);
    put!(header, 70, [4_i16, 16]);
    put!(header, 76, [1_f32, 0.5, 0.5, 2.0, 1.0, 1.0, 1.0, 1.0]);
    put!(header, 108, [if is_pair { 0_f32 } else { 352.0 }, 1.0, 0.0]);
    header.bytes[123] = 2;
    put!(header, 252, [1_i16, 1]);
    put!(header, 256, [0_f32, 0.0, 0.0, 1.0, 2.0, 3.0]);
    put!(header, 280, [0.5_f32, 0.0, 0.0, 1.0, 0.0, 0.5, 0.0, 2.0, 0.0, 0.0, 2.0, 3.0]);
    header.bytes[344..348].copy_from_slice(if is_pair { b"ni1\0" } else { b"n+1\0" });
    header.bytes
}

fn nifti_2(is_big_endian: bool) -> Vec<u8> {
    let mut header = Header { bytes: vec![0; 544], is_big_endian };
    put!(header, 0, [540_i32]);
    header.bytes[4..12].copy_from_slice(b"n+2\0\r\n\x1a\n");
    put!(header, 12, [4_i16, 16]);
    put!(header, 16, [3_i64, 9, 8, 7, 1, 1, 1, 1]);
    put!(header, 104, [1_f64, 0.5, 0.5, 2.0, 1.0, 1.0, 1.0, 1.0]);
    put!(header, 168, [544_i64]);
    put!(header, 176, [1_f64, 0.0]);
    put!(header, 348, [1_i32]);
    put!(header, 400, [0.5_f64, 0.0, 0.0, 1.0, 0.0, 0.5, 0.0, 2.0, 0.0, 0.0, 2.0, 3.0]);
    put!(header, 500, [2_i32]);
    header.bytes
}

pub(super) fn nifti_1_files() -> Vec<Seed> {
    let big = [nifti_1(true, false), raw(true)].concat();
    // An extension of 32 bytes behind the header.
    let mut extended = nifti_1(false, false);
    extended[108..112].copy_from_slice(&384_f32.to_le_bytes());
    extended[348] = 1;
    extended.extend([32_i32, 6].map(i32::to_le_bytes).concat());
    extended.extend([b'x'; 24]);
    extended.extend(raw(false));
    [written(), big, extended].map(|bytes| Seed::plain("a.nii", bytes)).to_vec()
}

pub(super) fn nifti_2_files() -> Vec<Seed> {
    [false, true].map(|big| Seed::plain("a.nii", [nifti_2(big), raw(big)].concat())).to_vec()
}

pub(super) fn nifti_gz_files() -> Vec<Seed> {
    let gz =
        |plain| Seed::of(vec![SeedFile { name: "a.nii.gz", parts: vec![Part::new(plain, Packing::Gzip)] }]);
    vec![gz(written()), gz([nifti_2(false), raw(false)].concat())]
}

pub(super) fn nifti_pairs() -> Vec<Seed> {
    let image = SeedFile { name: "a.img.gz", parts: vec![Part::new(raw(false), Packing::Gzip)] };
    vec![
        Seed::of(vec![SeedFile::plain("a.hdr", nifti_1(false, true)), SeedFile::plain("a.img", raw(false))]),
        Seed::of(vec![SeedFile::plain("a.hdr", nifti_1(false, true)), image]),
    ]
}

fn nrrd_header(encoding: &str, data_file: &str) -> Vec<u8> {
    format!(
        "NRRD0005\n# a comment\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 9 8 7\nspace \
         directions: (0.5,0,0) (0,0.5,0) (0,0,2)\nkinds: domain domain domain\nendian: little\nencoding: {encoding}\n\
         space origin: (1,2,3)\n{data_file}key:=value\n\n"
    )
    .into_bytes()
}

fn written_out() -> Vec<u8> {
    values().iter().map(i16::to_string).collect::<Vec<_>>().join(" ").into_bytes()
}

pub(super) fn nrrd_files() -> Vec<Seed> {
    let packings = [
        ("raw", Part::new(raw(false), Packing::Plain)),
        ("gzip", Part::new(raw(false), Packing::Gzip)),
        ("bzip2", Part::new(raw(false), Packing::Bzip2)),
        ("ascii", Part::new(written_out(), Packing::Plain)),
    ];
    let seed = |(encoding, data): (&str, Part)| {
        let parts = vec![Part::new(nrrd_header(encoding, ""), Packing::Plain), data];
        Seed::of(vec![SeedFile { name: "a.nrrd", parts }])
    };
    let mut seeds: Vec<Seed> = packings.into_iter().map(seed).collect();
    let four = b"NRRD0004\ntype: uchar\ndimension: 4\nspace: right-anterior-superior\nsizes: 2 3 4 5\nspace directions: \
                 none (1,0,0) (0,1,0.1) (0,0,1)\nkinds: list domain domain domain\nspace units: \"mm\" \"mm\" \"mm\"\n\
                 encoding: raw\nbyte skip: -1\nline skip: 0\nspace origin: (0,0,0)\n\n";
    seeds.push(Seed::plain("a.nrrd", [four.to_vec(), (0..120).collect()].concat()));
    seeds
}

pub(super) fn nhdr_files() -> Vec<Seed> {
    let seed = |encoding: &str, data: SeedFile| {
        let header = nrrd_header(encoding, &format!("data file: {}\n", data.name));
        Seed::of(vec![SeedFile::plain("a.nhdr", header), data])
    };
    let gz = SeedFile { name: "a.raw.gz", parts: vec![Part::new(raw(false), Packing::Gzip)] };
    vec![
        seed("raw", SeedFile::plain("a.raw", raw(false))),
        seed("gzip", gz),
        seed("ascii", SeedFile::plain("a.txt", written_out())),
    ]
}

fn meta_header(is_compressed: bool, data_file: &str) -> Vec<u8> {
    let is_compressed = if is_compressed { "True" } else { "False" };
    format!(
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = \
         {is_compressed}\nTransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = 1 2 3\nCenterOfRotation = 0 0 0\n\
         AnatomicalOrientation = RAI\nElementSpacing = 0.5 0.5 2\nDimSize = 9 8 7\nElementNumberOfChannels = 1\n\
         ElementType = MET_SHORT\nElementDataFile = {data_file}\n"
    )
    .into_bytes()
}

pub(super) fn mha_files() -> Vec<Seed> {
    let seed = |is_compressed: bool, packing: Packing| {
        let header = Part::new(meta_header(is_compressed, "LOCAL"), Packing::Plain);
        Seed::of(vec![SeedFile { name: "a.mha", parts: vec![header, Part::new(raw(false), packing)] }])
    };
    vec![seed(false, Packing::Plain), seed(true, Packing::Gzip)]
}

pub(super) fn mhd_files() -> Vec<Seed> {
    let seed = |is_compressed: bool, data: SeedFile| {
        Seed::of(vec![SeedFile::plain("a.mhd", meta_header(is_compressed, data.name)), data])
    };
    let gz = SeedFile { name: "a.zraw", parts: vec![Part::new(raw(false), Packing::Gzip)] };
    vec![seed(false, SeedFile::plain("a.raw", raw(false))), seed(true, gz)]
}

pub(super) fn swc_files() -> Vec<Seed> {
    let odd =
        "\u{FEFF}# head\r\n1 1 0 0 0 5 -1\r\n2,3,0,1.5,1e-3,1,1\n\t3 3 0 -2 2.5 .5 2 # x\n4 3 1 2 3 0 2";
    let cases = crate::degenerate::cases(0.002);
    let cases = cases.into_iter().filter(|(_, text)| text.len() < 10_000).map(|(_, text)| text);
    cases.chain([odd.to_owned()]).map(|text| Seed::plain("a.swc", text)).collect()
}

/// Three points on a line and one aside.
const POINTS: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [0.0, 0.0, 1.5], [0.0, 0.25, 3.0], [1.0, 0.5, 2.0]];
/// The ends of the two lines, and their points.
const ENDS: [i64; 2] = [3, 5];
const CORNERS: [i64; 5] = [0, 1, 2, 1, 3];

/// Polylines in XML: written out, appended as bytes, and those packed.
pub(super) fn vtp_files(own: &[u8]) -> Vec<Seed> {
    let (points, radii) = (POINTS.concat(), vec![1.0_f32, 0.5, 0.25, 0.5]);
    let words = |numbers: &[f32]| numbers.iter().map(f32::to_string).collect::<Vec<_>>().join(" ");
    let whole = |numbers: &[i64]| numbers.iter().map(i64::to_string).collect::<Vec<_>>().join(" ");
    let text = vtp(
        "",
        &[
            ("ascii\"", words(&points)),
            ("ascii\"", whole(&CORNERS)),
            ("ascii\"", whole(&ENDS)),
            ("ascii\"", words(&radii)),
        ],
    );
    let ascii = Seed::plain("a.vtp", format!("{text}</VTKFile>\n"));

    let floats = |numbers: &[f32]| numbers.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
    let ints = |numbers: &[i64]| numbers.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>();
    let arrays = [floats(&points), ints(&CORNERS), ints(&ENDS), floats(&radii)];
    let appended = |packing: Packing| {
        let mut parts = vec![Part::new(Vec::new(), Packing::Plain)];
        let (mut offsets, mut n_bytes) = (Vec::new(), 0);
        for array in &arrays {
            let part = if packing == Packing::Plain {
                Part::new([(array.len() as u32).to_le_bytes().to_vec(), array.clone()].concat(), packing)
            } else {
                Part::new(array.clone(), packing)
            };
            offsets.push(n_bytes);
            n_bytes += super::mutate::packed(&part).len();
            parts.push(part);
        }
        let format = |i: usize| (format!("appended\" offset=\"{}\"", offsets[i]), String::new());
        let compressor = if packing == Packing::Plain { "" } else { " compressor=\"vtkZLibDataCompressor\"" };
        let [a, b, c, d] = [0, 1, 2, 3].map(format);
        let head = vtp(compressor, &[(&a.0, a.1), (&b.0, b.1), (&c.0, c.1), (&d.0, d.1)]);
        parts[0].plain = format!("{head}<AppendedData encoding=\"raw\">_").into_bytes();
        parts.push(Part::new("</AppendedData></VTKFile>\n", Packing::Plain));
        Seed::of(vec![SeedFile { name: "a.vtp", parts }])
    };
    vec![ascii, appended(Packing::Plain), appended(Packing::VtkZlib), Seed::plain("a.vtp", own)]
}

/// A file up to its appended data; each array with its format (and the quote that ends it) and its text.
fn vtp(compressor: &str, arrays: &[(&str, String); 4]) -> String {
    let array = |i: usize, kind: &str, name: &str| {
        let (format, text) = (arrays[i].0, &arrays[i].1);
        format!("<DataArray type=\"{kind}\" Name=\"{name}\" format=\"{format}>{text}</DataArray>\n")
    };
    let points = array(0, "Float32", "Points").replace("Name=", "NumberOfComponents=\"3\" Name=");
    format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"0.1\" byte_order=\"LittleEndian\"{compressor}>\n\
         <PolyData><FieldData><Array type=\"String\" Name=\"SPACE\" NumberOfTuples=\"1\" format=\"ascii\">82 65 83 \
         0</Array></FieldData>\n<Piece NumberOfPoints=\"4\" NumberOfVerts=\"0\" NumberOfLines=\"2\" \
         NumberOfStrips=\"0\" NumberOfPolys=\"0\">\n<PointData>{}</PointData><Points>{points}</Points>\n\
         <Lines>{}{}</Lines>\n</Piece></PolyData>\n",
        array(3, "Float32", "MaximumInscribedSphereRadius"),
        array(1, "Int64", "connectivity"),
        array(2, "Int64", "offsets"),
    )
}

/// Polylines in the legacy format: ascii, binary, and ascii of version 5.
pub(super) fn vtk_files() -> Vec<Seed> {
    let head = |version: &str, kind: &str| {
        format!(
            "# vtk DataFile Version {version}\nmade here SPACE=RAS\n{kind}\nDATASET POLYDATA\nPOINTS 4 float\n"
        )
    };
    let words = POINTS.concat().iter().map(f32::to_string).collect::<Vec<_>>().join(" ");
    let old = format!(
        "{}{words}\nLINES 2 7\n3 0 1 2\n2 1 3\nCELL_DATA 2\nFIELD FieldData 1\nCenterlineIds 1 2 int\n0 1\nPOINT_DATA 4\n\
         SCALARS radius float 1\nLOOKUP_TABLE default\n1 0.5 0.25 0.5\n",
        head("3.0", "ASCII")
    );
    let new = format!(
        "{}{words}\nMETADATA\nINFORMATION 0\n\nLINES 3 5\nOFFSETS vtktypeint64\n0 3 5\nCONNECTIVITY vtktypeint64\n\
         0 1 2 1 3\nPOINT_DATA 4\nFIELD FieldData 1\nRadius 1 4 double\n1 0.5 0.25 0.5\n",
        head("5.1", "ASCII")
    );
    let big = |numbers: &[i32]| numbers.iter().flat_map(|n| n.to_be_bytes()).collect::<Vec<u8>>();
    let floats = |numbers: &[f32]| numbers.iter().flat_map(|n| n.to_be_bytes()).collect::<Vec<u8>>();
    let binary = [
        head("3.0", "BINARY").into_bytes(),
        floats(&POINTS.concat()),
        b"\nLINES 2 7\n".to_vec(),
        big(&[3, 0, 1, 2, 2, 1, 3]),
        b"\nPOINT_DATA 4\nSCALARS radius float\nLOOKUP_TABLE default\n".to_vec(),
        floats(&[1.0, 0.5, 0.25, 0.5]),
        b"\n".to_vec(),
    ];
    vec![Seed::plain("a.vtk", old), Seed::plain("a.vtk", new), Seed::plain("a.vtk", binary.concat())]
}
