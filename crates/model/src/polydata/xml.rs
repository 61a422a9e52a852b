//! VTK's XML format, `.vtp`.
//!
//! **Input** bytes. **Output** [`Dataset`].
//! **Steps** 1. appended bytes, which are no XML, are cut out; 2. the XML; 3. of each piece the points, the lines, and
//! the arrays that are used; 4. pieces one after another.
//! **Guarantees** declared counts are compared with what the bytes can hold before anything is made of them, and all
//! pieces together with the memory that is left; arrays that share bytes are refused where that would take long; external
//! entities are not resolved.

use std::borrow::Cow;
use std::cell::Cell;

use roxmltree::{Document, Node, ParsingOptions};

use super::encoded::{self, Encoding};
use super::{Budget, Dataset, NUMBERS_OF_LINE, PolydataError, RADIUS_NAMES};

/// A file, and how it writes its arrays.
struct File<'a> {
    encoding: Encoding,
    /// The bytes behind the underscore of the appended data.
    appended: Option<&'a [u8]>,
    is_appended_raw: bool,
    /// Where arrays begin in them, ascending.
    offsets: Vec<usize>,
    n_bytes: usize,
    /// How many more numbers its arrays may make, all pieces together: they may name the same compressed bytes.
    budget: &'a Budget,
    /// How many more appended bytes may be looked at.
    n_to_see: Cell<usize>,
}

/// Appended bytes may be looked at so often, all arrays together. No program lets arrays share them.
const MAX_SHARED: usize = 4;
/// A file of polylines has some tens of elements, one of many pieces some thousands; each takes a hundred bytes, and the
/// parser makes room for as many as there are signs before it looks at one.
const MAX_NODES: u32 = 1 << 18;
/// What an element or an attribute takes, in numbers of the budget.
const NUMBERS_OF_NODE: usize = 4;
/// The parser compares each attribute of an element with all others; none that VTK writes is a tenth as long.
const MAX_TAG_BYTES: usize = 4096;
/// How much of what a parser says is shown.
const N_SHOWN: usize = 200;

pub(super) fn parse(bytes: &[u8], budget: &Budget) -> Result<Dataset, PolydataError> {
    let (text, appended) = cut_appended(bytes);
    let text = String::from_utf8_lossy(&text);
    check_tags(&text, budget)?;
    let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    let document = Document::parse_with_options(&text, options).map_err(|error| {
        let printable =
            error.to_string().chars().filter(|letter| !letter.is_control()).take(N_SHOWN).collect();
        PolydataError::Xml { cause: printable }
    })?;
    let root = document.root_element();
    if root.tag_name().name() != "VTKFile" || root.attribute("type") != Some("PolyData") {
        let found = shown(root.attribute("type").unwrap_or_else(|| root.tag_name().name()));
        return Err(PolydataError::Unknown { what: "a VTK file of this type", found });
    }
    let file = File {
        encoding: encoding(root)?,
        appended,
        is_appended_raw: descendant(root, "AppendedData").and_then(|node| node.attribute("encoding"))
            == Some("raw"),
        offsets: offsets(root),
        n_bytes: bytes.len(),
        budget,
        n_to_see: Cell::new(bytes.len().saturating_mul(MAX_SHARED)),
    };
    let mut dataset = Dataset { space: space(root), ..Dataset::default() };
    for piece in root.descendants().filter(|node| node.has_tag_name("Piece")) {
        read_piece(&file, piece, &mut dataset)?;
    }
    Ok(dataset)
}

fn shown(text: &str) -> String {
    text.chars().take(40).collect()
}

/// Refuses more elements, and elements with more attributes, than there are in any file.
fn check_tags(text: &str, budget: &Budget) -> Result<(), PolydataError> {
    let n_signs = |sign: u8| text.bytes().filter(|&byte| byte == sign).count();
    let is_long = |tag: &str| tag.len() > MAX_TAG_BYTES && !tag.starts_with(['!', '?']);
    let tag = |part: &str| part.split('>').next().is_some_and(is_long);
    budget.spend((n_signs(b'<') + n_signs(b'=')) * NUMBERS_OF_NODE)?;
    let cause = if n_signs(b'<').max(n_signs(b'=')) > MAX_NODES as usize {
        format!("it has more than {MAX_NODES} elements or attributes")
    } else if text.split('<').skip(1).any(tag) {
        format!("it has an element with more than {MAX_TAG_BYTES} bytes of attributes")
    } else {
        return Ok(());
    };
    Err(PolydataError::Xml { cause })
}

/// The XML without the bytes that are appended to it, and those.
fn cut_appended(bytes: &[u8]) -> (Cow<'_, [u8]>, Option<&[u8]>) {
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
            (Cow::Owned([&bytes[..tag_end], &bytes[end..]].concat()), Some(&bytes[start..end]))
        }
        None => (Cow::Borrowed(bytes), None),
    }
}

fn encoding(root: Node<'_, '_>) -> Result<Encoding, PolydataError> {
    let compressor = root.attribute("compressor").unwrap_or_default();
    if !matches!(compressor, "" | "vtkZLibDataCompressor") {
        return Err(PolydataError::Unknown { what: "this compression", found: shown(compressor) });
    }
    let word_bytes = match root.attribute("header_type").unwrap_or("UInt32") {
        "UInt32" => 4,
        "UInt64" => 8,
        found => return Err(PolydataError::Unknown { what: "this header_type", found: shown(found) }),
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
    file.budget.spend(n_lines.saturating_mul(NUMBERS_OF_LINE))?;
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
        let name = || shown(array.attribute("Name").unwrap_or("an array"));
        let text = array.text().unwrap_or_default();
        let scalar = array.attribute("type").unwrap_or_default();
        self.budget.spend(expected)?;
        let numbers = match array.attribute("format").unwrap_or("ascii") {
            "ascii" => {
                let words = || text.split_whitespace();
                let found = words().count();
                if found != expected {
                    return Err(PolydataError::Count { what: name(), found, expected });
                }
                let number = |word: &str| {
                    word.parse().map_err(|_| PolydataError::Word { what: "a number", found: shown(word) })
                };
                words().map(number).collect::<Result<Vec<f64>, _>>()?
            }
            format => {
                let number_bytes = encoded::scalar_bytes(scalar).ok_or_else(|| PolydataError::Unknown {
                    what: "numbers of this type",
                    found: shown(scalar),
                })?;
                let damaged = |cause| PolydataError::Bytes { array: name(), cause };
                if expected == 0 {
                    return Ok(Vec::new());
                }
                let expected_bytes = expected.saturating_mul(number_bytes);
                let packed = match format {
                    "binary" => encoded::from_base64(text.as_bytes()).map(Cow::Owned),
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
    fn appended_at(&self, offset: Option<&str>) -> Result<Cow<'_, [u8]>, &'static str> {
        let offset: usize = offset.and_then(|text| text.parse().ok()).ok_or("its offset is no number")?;
        let appended = self.appended.ok_or("there is no appended data")?;
        let after = self.offsets.partition_point(|&known| known <= offset);
        let next = self.offsets.get(after).copied().unwrap_or(appended.len());
        let bytes =
            appended.get(offset..next.min(appended.len())).ok_or("its offset lies behind the data")?;
        let n_to_see = self.n_to_see.get().checked_sub(bytes.len());
        self.n_to_see.set(n_to_see.ok_or("other arrays name the same bytes, too often")?);
        if self.is_appended_raw {
            Ok(Cow::Borrowed(bytes))
        } else {
            encoded::from_base64(bytes).map(Cow::Owned)
        }
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
            budget: &Budget::of(20 * super::super::BYTES_OF_NUMBER, 0),
            n_to_see: Cell::new(0),
        };
        let read = || file.numbers(document.root_element(), 8);
        assert_eq!(read().expect("8 of 20").len(), 8);
        assert_eq!(read().expect("16 of 20").len(), 8);
        assert!(matches!(read(), Err(PolydataError::TooLarge { limit: 640 })));
    }

    /// Thousands of pieces that each name all appended bytes: each would unpack them again.
    #[test]
    fn shared_bytes_are_not_read_for_ever() {
        let piece = "<Piece NumberOfPoints=\"1\"><Points><DataArray type=\"Float32\" format=\"appended\" \
                     offset=\"0\"/></Points></Piece>";
        let text = format!(
            "<VTKFile type=\"PolyData\"><PolyData>{}</PolyData><AppendedData encoding=\"base64\">_DAAAAAAAAAAAAAAAAAAA\
             AA=={}</AppendedData></VTKFile>",
            piece.repeat(2000),
            "A".repeat(200_000)
        );
        let error =
            parse(text.as_bytes(), &Budget::of(1 << 30, text.len())).expect_err("refused").to_string();
        assert!(error.contains("too often"), "{error}");
    }

    /// The XML parser takes time with the square of an element's attributes.
    #[test]
    fn thousands_of_attributes_are_refused() {
        let attributes: String = (0..50_000).map(|i| format!(" a{i}=\"\"")).collect();
        let text = format!("<VTKFile type=\"PolyData\"{attributes}/>");
        let error =
            parse(text.as_bytes(), &Budget::of(1 << 30, text.len())).expect_err("refused").to_string();
        assert!(error.contains("attributes"), "{error}");
    }
}
