//! VTK's XML format, `.vtp`.
//!
//! **Input** bytes. **Output** [`Dataset`].
//! **Steps** 1. appended bytes, which are no XML, are cut out; 2. the XML; 3. of each piece the points, the lines, and
//! the arrays that are used; 4. pieces one after another.
//! **Guarantees** declared counts are compared with what the bytes can hold before anything is made of them, and all
//! pieces together make no more than [`MAX_NUMBERS`] of compressed ones; external entities are not resolved.

use std::cell::Cell;

use roxmltree::{Document, Node};

use super::encoded::{self, Encoding};
use super::{Dataset, PolydataError, RADIUS_NAMES};

/// A file, and how it writes its arrays.
struct File<'a> {
    encoding: Encoding,
    /// The bytes behind the underscore of the appended data.
    appended: Option<&'a [u8]>,
    is_appended_raw: bool,
    /// Where arrays begin in them, ascending.
    offsets: Vec<usize>,
    n_bytes: usize,
    /// How many more numbers its arrays may make, all pieces together.
    n_left: Cell<usize>,
}

/// Arrays of numbers that no file of polylines has: 1 GiB. Several pieces may name the same compressed bytes, so that
/// what each of them makes is not bounded by the file.
const MAX_NUMBERS: usize = 1 << 27;

pub(super) fn parse(bytes: &[u8]) -> Result<Dataset, PolydataError> {
    let (text, appended) = cut_appended(bytes);
    let text = String::from_utf8_lossy(&text).into_owned();
    let document = Document::parse(&text).map_err(|error| PolydataError::Xml { cause: error.to_string() })?;
    let root = document.root_element();
    if root.tag_name().name() != "VTKFile" || root.attribute("type") != Some("PolyData") {
        let found = root.attribute("type").unwrap_or_else(|| root.tag_name().name()).to_owned();
        return Err(PolydataError::Unknown { what: "a VTK file of this type", found });
    }
    let file = File {
        encoding: encoding(root)?,
        appended,
        is_appended_raw: descendant(root, "AppendedData").and_then(|node| node.attribute("encoding"))
            == Some("raw"),
        offsets: offsets(root),
        n_bytes: bytes.len(),
        n_left: Cell::new(MAX_NUMBERS),
    };
    let mut dataset = Dataset { space: space(root), ..Dataset::default() };
    for piece in root.descendants().filter(|node| node.has_tag_name("Piece")) {
        read_piece(&file, piece, &mut dataset)?;
    }
    Ok(dataset)
}

/// The XML without the bytes that are appended to it, and those.
fn cut_appended(bytes: &[u8]) -> (Vec<u8>, Option<&[u8]>) {
    let find = |needle: &[u8], from: usize| {
        bytes[from..].windows(needle.len()).position(|window| window == needle).map(|at| at + from)
    };
    let cut = || {
        let tag = find(b"<AppendedData", 0)?;
        let tag_end = find(b">", tag)? + 1;
        let start = find(b"_", tag_end)? + 1;
        let end = bytes.windows(15).rposition(|window| window == b"</AppendedData>")?;
        (start <= end).then_some((tag_end, start, end))
    };
    match cut() {
        Some((tag_end, start, end)) => {
            ([&bytes[..tag_end], &bytes[end..]].concat(), Some(&bytes[start..end]))
        }
        None => (bytes.to_vec(), None),
    }
}

fn encoding(root: Node<'_, '_>) -> Result<Encoding, PolydataError> {
    let compressor = root.attribute("compressor").unwrap_or_default();
    if !matches!(compressor, "" | "vtkZLibDataCompressor") {
        return Err(PolydataError::Unknown { what: "this compression", found: compressor.to_owned() });
    }
    let word_bytes = match root.attribute("header_type").unwrap_or("UInt32") {
        "UInt32" => 4,
        "UInt64" => 8,
        found => return Err(PolydataError::Unknown { what: "this header_type", found: found.to_owned() }),
    };
    Ok(Encoding {
        is_big_endian: root.attribute("byte_order") == Some("BigEndian"),
        word_bytes,
        is_compressed: !compressor.is_empty(),
    })
}

fn offsets(root: Node<'_, '_>) -> Vec<usize> {
    let arrays =
        root.descendants().filter(|node| node.has_tag_name("DataArray") || node.has_tag_name("Array"));
    let mut offsets: Vec<usize> = arrays.filter_map(|node| node.attribute("offset")?.parse().ok()).collect();
    offsets.sort_unstable();
    offsets.dedup();
    offsets
}

/// What the field `SPACE` says, which 3D Slicer writes: the codes of its letters.
fn space(root: Node<'_, '_>) -> Option<String> {
    let field = root.descendants().find(|node| node.attribute("Name") == Some("SPACE"))?;
    let letter = |code: &str| code.parse::<u8>().ok().filter(u8::is_ascii_uppercase).map(char::from);
    Some(field.text()?.split_whitespace().filter_map(letter).collect())
}

fn descendant<'a, 'input>(node: Node<'a, 'input>, name: &str) -> Option<Node<'a, 'input>> {
    node.descendants().find(|node| node.has_tag_name(name))
}

fn read_piece(file: &File<'_>, piece: Node<'_, '_>, dataset: &mut Dataset) -> Result<(), PolydataError> {
    let count = |name: &'static str| match piece.attribute(name) {
        None => Ok(0),
        Some(text) => text
            .parse::<usize>()
            .ok()
            // Each point takes a letter at the least, in whatever encoding but a compressed one.
            .filter(|&n| n <= file.n_bytes.saturating_mul(1032))
            .ok_or_else(|| PolydataError::Word { what: name, found: text.chars().take(40).collect() }),
    };
    let (n_points, n_lines) = (count("NumberOfPoints")?, count("NumberOfLines")?);
    let n_verts = count("NumberOfVerts")?;
    let n_cells = n_verts + n_lines + count("NumberOfStrips")? + count("NumberOfPolys")?;
    let child = |name: &str| piece.children().find(|node| node.has_tag_name(name));
    let first_point = dataset.points.len() / 3;
    let first_line = dataset.lines.len();
    dataset.n_other_cells += n_cells - n_lines;
    if n_points > 0 {
        let array =
            child("Points").and_then(|node| node.children().find(|node| node.has_tag_name("DataArray")));
        let array = array.ok_or(PolydataError::Missing { what: "array of points" })?;
        dataset.points.extend(file.numbers(array, 3 * n_points)?);
    }
    if n_lines > 0 {
        let lines = child("Lines").ok_or(PolydataError::Missing { what: "array of lines" })?;
        dataset.lines.extend(read_lines(file, lines, n_lines, first_point)?);
    }
    for array in arrays_of(child("PointData"), &RADIUS_NAMES) {
        append(&mut dataset.point_arrays, array.0, first_point, file.numbers(array.1, n_points)?);
    }
    for array in arrays_of(child("CellData"), &["CenterlineIds", "TractIds"]) {
        let numbers = file.numbers(array.1, n_cells)?;
        append(&mut dataset.cell_arrays, array.0, first_line, numbers[n_verts..n_verts + n_lines].to_vec());
    }
    Ok(())
}

/// The arrays of some names with one number for each point or cell.
fn arrays_of<'a>(data: Option<Node<'a, 'a>>, names: &[&str]) -> Vec<(&'a str, Node<'a, 'a>)> {
    let arrays =
        data.into_iter().flat_map(|node| node.children()).filter(|node| node.has_tag_name("DataArray"));
    let wanted = arrays.filter_map(|node| {
        let name = node.attribute("Name").filter(|name| names.contains(name))?;
        (node.attribute("NumberOfComponents").unwrap_or("1").trim() == "1").then_some((name, node))
    });
    wanted.collect()
}

/// Appends a piece's numbers to those of the pieces before it; what earlier pieces lack is 0.
fn append(arrays: &mut Vec<(String, Vec<f64>)>, name: &str, n_before: usize, numbers: Vec<f64>) {
    let known = arrays.iter().position(|(known, _)| known == name);
    let index = known.unwrap_or_else(|| {
        arrays.push((name.to_owned(), Vec::new()));
        arrays.len() - 1
    });
    let array = &mut arrays[index].1;
    array.resize(n_before, 0.0);
    array.extend(numbers);
}

fn read_lines(
    file: &File<'_>,
    lines: Node<'_, '_>,
    n_lines: usize,
    first_point: usize,
) -> Result<Vec<Vec<usize>>, PolydataError> {
    let array = |name| {
        lines
            .children()
            .find(|node| node.attribute("Name") == Some(name))
            .ok_or(PolydataError::Missing { what: "array of lines" })
    };
    let offsets = file.numbers(array("offsets")?, n_lines)?;
    let n_all = offsets.last().copied().unwrap_or(0.0);
    if !(0.0..=(file.n_bytes as f64 * 1032.0)).contains(&n_all) {
        return Err(PolydataError::Word { what: "the end of the last line", found: n_all.to_string() });
    }
    let points = file.numbers(array("connectivity")?, n_all as usize)?;
    let mut start = 0;
    let mut cut = Vec::with_capacity(offsets.len());
    for offset in offsets {
        let end = offset as usize;
        let line = points
            .get(start..end)
            .ok_or_else(|| PolydataError::Word { what: "the end of a line", found: offset.to_string() })?;
        let index = |&point: &f64| {
            if point >= 0.0 { (point as usize).saturating_add(first_point) } else { usize::MAX }
        };
        cut.push(line.iter().map(index).collect());
        start = end;
    }
    Ok(cut)
}

impl File<'_> {
    /// The `expected` numbers of an array.
    fn numbers(&self, array: Node<'_, '_>, expected: usize) -> Result<Vec<f64>, PolydataError> {
        let name = || array.attribute("Name").unwrap_or("an array").to_owned();
        let text = array.text().unwrap_or_default();
        let scalar = array.attribute("type").unwrap_or_default();
        let numbers = match array.attribute("format").unwrap_or("ascii") {
            "ascii" => text
                .split_whitespace()
                .map(|word| {
                    word.parse().map_err(|_| PolydataError::Word {
                        what: "a number",
                        found: word.chars().take(40).collect(),
                    })
                })
                .collect::<Result<Vec<f64>, _>>()?,
            format => {
                let number_bytes = encoded::scalar_bytes(scalar).ok_or_else(|| PolydataError::Unknown {
                    what: "numbers of this type",
                    found: scalar.to_owned(),
                })?;
                let damaged = |cause| PolydataError::Bytes { array: name(), cause };
                let n_left = self.n_left.get().checked_sub(expected);
                self.n_left
                    .set(n_left.ok_or_else(|| damaged("with it the file holds more than 1 GiB of numbers"))?);
                if expected == 0 {
                    return Ok(Vec::new());
                }
                let expected_bytes = expected.saturating_mul(number_bytes);
                let packed = match format {
                    "binary" => encoded::from_base64(text.as_bytes()),
                    "appended" => self.appended_at(array.attribute("offset")),
                    _ => Err("its format is unknown"),
                };
                let bytes = packed.and_then(|packed| encoded::block(&packed, self.encoding, expected_bytes));
                encoded::numbers(&bytes.map_err(damaged)?, scalar, self.encoding.is_big_endian)
                    .unwrap_or_default()
            }
        };
        if numbers.len() == expected {
            return Ok(numbers);
        }
        Err(PolydataError::Count { what: name(), found: numbers.len(), expected })
    }

    /// The appended bytes of an array, to where the next one begins.
    fn appended_at(&self, offset: Option<&str>) -> Result<Vec<u8>, &'static str> {
        let offset: usize = offset.and_then(|text| text.parse().ok()).ok_or("its offset is no number")?;
        let appended = self.appended.ok_or("there is no appended data")?;
        let next = self.offsets.iter().copied().find(|&next| next > offset).unwrap_or(appended.len());
        let bytes =
            appended.get(offset..next.min(appended.len())).ok_or("its offset lies behind the data")?;
        if self.is_appended_raw { Ok(bytes.to_vec()) } else { encoded::from_base64(bytes) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two pieces of one file that name the same bytes, and both more than the file may make of them.
    #[test]
    fn pieces_are_bounded_together() {
        // The length, 8 bytes, and 8 numbers of one byte.
        let text = "<DataArray type=\"UInt8\" format=\"binary\">CAAAAAECAwQFBgcI</DataArray>";
        let document = Document::parse(text).expect("legal XML");
        let encoding = Encoding { is_big_endian: false, word_bytes: 4, is_compressed: false };
        let file = File {
            encoding,
            appended: None,
            is_appended_raw: false,
            offsets: Vec::new(),
            n_bytes: text.len(),
            n_left: Cell::new(20),
        };
        let read = || file.numbers(document.root_element(), 8);
        assert_eq!(read().expect("8 of 20").len(), 8);
        assert_eq!(read().expect("16 of 20").len(), 8);
        let error = read().expect_err("24 of 20").to_string();
        assert!(error.contains("1 GiB"), "{error}");
    }
}
