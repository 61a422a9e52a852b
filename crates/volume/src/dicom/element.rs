//! The data elements of a DICOM file that are needed here, and where its pixels begin.
//!
//! **Input** the first bytes of a file, and whether they are all of it. **Output** [`Elements`].
//! **Steps** 1. the preamble and the meta group, which states the encoding; without them the encoding is told from
//! the first element; 2. element after element up to the pixel data: values that are asked for are kept, all others
//! passed over, sequences whole.
//! **Guarantees** no recursion, however deep sequences nest; no length is believed beyond the bytes at hand; nothing
//! is kept but the elements of [`WANTED`], so no name, date or place of a patient is ever held.
//! **Source** DICOM PS3.5 sections 7.1 (elements), 7.5 (sequences), PS3.10 section 7.1 (preamble and meta group).
//!
//! Why not `dicom-object`? Its reader recurses into sequences, so that 960 kB of nested ones overflow the stack and
//! kill the program, and a file of 300 bytes that declares a string of 2 GiB takes 2.1 GB of memory (0.10.1).
//! What is needed of a header is a dozen numbers.

use espalier_model::bytes::from_lowest;

/// A tag: group in the high 16 bits, element in the low ones.
pub(super) type Tag = u32;

pub(super) const TRANSFER_SYNTAX: Tag = 0x0002_0010;
pub(super) const IMAGE_TYPE: Tag = 0x0008_0008;
pub(super) const MODALITY: Tag = 0x0008_0060;
pub(super) const ECHO: Tag = 0x0018_0086;
pub(super) const SERIES_UID: Tag = 0x0020_000E;
pub(super) const SERIES_NUMBER: Tag = 0x0020_0011;
pub(super) const ACQUISITION: Tag = 0x0020_0012;
pub(super) const POSITION: Tag = 0x0020_0032;
pub(super) const ORIENTATION: Tag = 0x0020_0037;
pub(super) const TEMPORAL: Tag = 0x0020_0100;
pub(super) const SAMPLES: Tag = 0x0028_0002;
pub(super) const PHOTOMETRIC: Tag = 0x0028_0004;
pub(super) const FRAMES: Tag = 0x0028_0008;
pub(super) const ROWS: Tag = 0x0028_0010;
pub(super) const COLUMNS: Tag = 0x0028_0011;
pub(super) const PIXEL_SPACING: Tag = 0x0028_0030;
pub(super) const BITS_ALLOCATED: Tag = 0x0028_0100;
pub(super) const BITS_STORED: Tag = 0x0028_0101;
pub(super) const HIGH_BIT: Tag = 0x0028_0102;
pub(super) const SIGNED: Tag = 0x0028_0103;
pub(super) const PADDING: Tag = 0x0028_0120;
pub(super) const PADDING_LIMIT: Tag = 0x0028_0121;
pub(super) const INTERCEPT: Tag = 0x0028_1052;
pub(super) const SLOPE: Tag = 0x0028_1053;
pub(super) const LOSSY: Tag = 0x0028_2110;

/// What is kept of a header.
const WANTED: [Tag; 25] = [
    TRANSFER_SYNTAX,
    IMAGE_TYPE,
    MODALITY,
    ECHO,
    SERIES_UID,
    SERIES_NUMBER,
    ACQUISITION,
    POSITION,
    ORIENTATION,
    TEMPORAL,
    SAMPLES,
    PHOTOMETRIC,
    FRAMES,
    ROWS,
    COLUMNS,
    PIXEL_SPACING,
    BITS_ALLOCATED,
    BITS_STORED,
    HIGH_BIT,
    SIGNED,
    PADDING,
    PADDING_LIMIT,
    INTERCEPT,
    SLOPE,
    LOSSY,
];

const FLOAT_PIXELS: Tag = 0x7FE0_0008;
const DOUBLE_PIXELS: Tag = 0x7FE0_0009;
const PIXELS: Tag = 0x7FE0_0010;
const ITEM: Tag = 0xFFFE_E000;
const ITEM_END: Tag = 0xFFFE_E00D;
const SEQUENCE_END: Tag = 0xFFFE_E0DD;
/// The length that says "until the delimiter".
const UNDEFINED: u32 = u32::MAX;
/// Where the letters `DICM` stand.
const MAGIC_AT: usize = 128;
/// Values that are asked for are short; a longer one is none.
const MAX_VALUE_BYTES: usize = 1024;
/// No object that is meant nests its sequences as deep.
const MAX_DEPTH: usize = 256;
/// The representations with a length of 32 bits, PS3.5 table 7.1-1.
const LONG: [&[u8; 2]; 13] =
    [b"OB", b"OD", b"OF", b"OL", b"OV", b"OW", b"SQ", b"SV", b"UC", b"UN", b"UR", b"UT", b"UV"];

/// How elements are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Encoding {
    /// Whether each element states its value representation.
    pub(super) is_explicit: bool,
    pub(super) is_big_endian: bool,
}

const IMPLICIT_LITTLE: Encoding = Encoding { is_explicit: false, is_big_endian: false };
const EXPLICIT_LITTLE: Encoding = Encoding { is_explicit: true, is_big_endian: false };
const EXPLICIT_BIG: Encoding = Encoding { is_explicit: true, is_big_endian: true };

/// Why the elements end before the pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fault {
    /// The bytes at hand end inside an element.
    Short,
    /// What stands there is no element.
    Malformed(&'static str),
}

/// Where the pixels are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PixelPlace {
    /// The first byte of the value, from the beginning of the bytes.
    pub(super) offset: usize,
    /// Its length; `None` where it is cut into fragments, as compressed pixels are.
    pub(super) length: Option<u32>,
    /// Whether the numbers are words of 16 bits, which big-endian files swap even where samples have 8.
    pub(super) is_words: bool,
}

/// The elements of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Elements {
    values: Vec<(Tag, Vec<u8>)>,
    pub(super) encoding: Encoding,
    /// Whole numbers of 8 or 16 bits.
    pub(super) pixels: Option<PixelPlace>,
    /// Whether the pixels are floats.
    pub(super) has_float_pixels: bool,
    /// Set where the elements end before they should; what came before stands.
    pub(super) fault: Option<Fault>,
}

/// Where the data set begins, and what the meta group before it says.
pub(super) struct Meta {
    /// The transfer syntax, where it is stated.
    pub(super) syntax: Option<String>,
    /// The first byte after the meta group.
    pub(super) end: usize,
}

/// Whether a file that begins with these bytes is DICOM: by the four letters after the preamble, or, where there is
/// no preamble, by a first element that only DICOM has.
pub(super) fn looks_like_dicom(start: &[u8]) -> bool {
    start.get(MAGIC_AT..MAGIC_AT + 4) == Some(b"DICM") || bare_encoding(start).is_some()
}

/// The encoding of a data set that begins at the first byte: its first element is of group 2 or 8, with a low
/// number, and its length is small or its representation one of DICOM's.
fn bare_encoding(start: &[u8]) -> Option<Encoding> {
    let &[a, b, c, d, e, f, g, h, ..] = start else { return None };
    let is_explicit = is_representation([e, f]);
    match [a, b, c, d] {
        [0x02 | 0x08, 0, _, 0] if is_explicit => Some(EXPLICIT_LITTLE),
        [0, 0x02 | 0x08, 0, _] if is_explicit => Some(EXPLICIT_BIG),
        [0x08, 0, 0x00 | 0x01 | 0x05 | 0x08 | 0x16 | 0x18, 0] if [f, g, h] == [0; 3] && e > 0 && e <= 64 => {
            Some(IMPLICIT_LITTLE)
        }
        _ => None,
    }
}

fn is_representation(letters: [u8; 2]) -> bool {
    const SHORT: [&[u8; 2]; 21] = [
        b"AE", b"AS", b"AT", b"CS", b"DA", b"DS", b"DT", b"FD", b"FL", b"IS", b"LO", b"LT", b"PN", b"SH",
        b"SL", b"SS", b"ST", b"TM", b"UI", b"UL", b"US",
    ];
    SHORT.iter().chain(&LONG).any(|known| **known == letters)
}

/// Reads the meta group, which is explicit and little-endian in every file.
pub(super) fn read_meta(bytes: &[u8]) -> Meta {
    let has_magic = bytes.get(MAGIC_AT..MAGIC_AT + 4) == Some(b"DICM");
    let start = if has_magic { MAGIC_AT + 4 } else { 0 };
    let mut meta = Meta { syntax: None, end: start };
    while let Ok(element) = read_element(bytes, meta.end, EXPLICIT_LITTLE) {
        let value = element.value_in(bytes);
        let (true, Some(value)) = (element.tag >> 16 == 2, value) else { break };
        if element.tag == TRANSFER_SYNTAX {
            meta.syntax = Some(trimmed(value));
        }
        meta.end = element.value + value.len();
    }
    meta
}

/// Reads the elements from `start` on, up to the pixels. `is_big_endian` is what the transfer syntax says;
/// whether representations are stated is seen from the first element, since some files deny it.
pub(super) fn read_elements(bytes: &[u8], start: usize, is_big_endian: bool) -> Elements {
    let bare = (start == 0).then(|| bare_encoding(bytes)).flatten();
    let states =
        bytes.get(start + 4..start + 6).is_some_and(|letters| is_representation([letters[0], letters[1]]));
    let encoding = bare.unwrap_or(Encoding { is_explicit: states || is_big_endian, is_big_endian });
    let mut elements =
        Elements { values: Vec::new(), encoding, pixels: None, has_float_pixels: false, fault: None };
    elements.fault = elements.walk(bytes, start).err();
    elements
}

/// A sequence or an item that ends at its delimiter.
#[derive(Clone, Copy)]
struct Level {
    is_item: bool,
    encoding: Encoding,
}

impl Elements {
    fn walk(&mut self, bytes: &[u8], start: usize) -> Result<(), Fault> {
        let mut levels: Vec<Level> = Vec::new();
        let mut at = start;
        while at < bytes.len() {
            let encoding = levels.last().map_or(self.encoding, |level| level.encoding);
            let element = read_element(bytes, at, encoding)?;
            if levels.is_empty() && self.is_at_pixels(&element) {
                return Ok(());
            }
            at = match element.length {
                _ if matches!(element.tag, ITEM_END | SEQUENCE_END) => {
                    let closes_item = element.tag == ITEM_END;
                    if levels.pop().is_none_or(|level| level.is_item != closes_item) {
                        return Err(Fault::Malformed("a delimiter closes what was not opened"));
                    }
                    element.value
                }
                UNDEFINED => {
                    levels.push(opened(&element, levels.last(), encoding)?);
                    if levels.len() > MAX_DEPTH {
                        return Err(Fault::Malformed("its sequences nest too deep"));
                    }
                    element.value
                }
                _ => {
                    let value = element.value_in(bytes).ok_or(Fault::Short)?;
                    if levels.is_empty() {
                        self.keep(&element, value);
                    }
                    element.value + value.len()
                }
            };
        }
        if levels.is_empty() { Ok(()) } else { Err(Fault::Short) }
    }

    fn is_at_pixels(&mut self, element: &Element) -> bool {
        match element.tag {
            PIXELS => {
                let length = (element.length != UNDEFINED).then_some(element.length);
                let is_words = element.representation == Some(*b"OW") || !self.encoding.is_explicit;
                self.pixels = Some(PixelPlace { offset: element.value, length, is_words });
            }
            FLOAT_PIXELS | DOUBLE_PIXELS => self.has_float_pixels = true,
            _ => return false,
        }
        true
    }

    fn keep(&mut self, element: &Element, value: &[u8]) {
        let is_wanted = WANTED.contains(&element.tag) && value.len() <= MAX_VALUE_BYTES;
        // The first of two is taken, as most readers do.
        if is_wanted && self.raw(element.tag).is_none() {
            self.values.push((element.tag, value.to_vec()));
        }
    }

    fn raw(&self, tag: Tag) -> Option<&[u8]> {
        self.values.iter().find(|(known, _)| *known == tag).map(|(_, value)| value.as_slice())
    }

    /// The text of an element without padding, where there is any.
    pub(super) fn text(&self, tag: Tag) -> Option<String> {
        self.raw(tag).map(trimmed).filter(|text| !text.is_empty())
    }

    /// The decimal numbers of an element; none where one of them is no finite number.
    pub(super) fn decimals(&self, tag: Tag) -> Option<Vec<f64>> {
        let number = |part: &str| part.trim().parse::<f64>().ok().filter(|value| value.is_finite());
        self.text(tag)?.split('\\').map(number).collect()
    }

    /// So many decimal numbers.
    pub(super) fn exactly<const N: usize>(&self, tag: Tag) -> Option<[f64; N]> {
        self.decimals(tag)?.try_into().ok()
    }

    /// An unsigned number of 16 bits.
    pub(super) fn short(&self, tag: Tag) -> Option<u16> {
        let pair = self.raw(tag)?.first_chunk().copied()?;
        Some(u16::from_le_bytes(from_lowest(pair, self.encoding.is_big_endian)))
    }
}

/// What an element of undefined length opens.
fn opened(element: &Element, inside: Option<&Level>, encoding: Encoding) -> Result<Level, Fault> {
    if element.tag == ITEM {
        return match inside {
            Some(level) if !level.is_item => Ok(Level { is_item: true, encoding: level.encoding }),
            _ => Err(Fault::Malformed("an item stands outside a sequence")),
        };
    }
    match element.representation {
        // Sequences of unknown representation are implicit inside, PS3.5 section 6.2.2.
        Some(letters) if letters == *b"UN" => Ok(Level { is_item: false, encoding: IMPLICIT_LITTLE }),
        // Compressed pixels, of an icon for one, are cut into items too.
        Some(letters) if ![*b"SQ", *b"OB", *b"OW"].contains(&letters) => {
            Err(Fault::Malformed("a value has no length"))
        }
        _ => Ok(Level { is_item: false, encoding }),
    }
}

/// The beginning of one element.
struct Element {
    tag: Tag,
    representation: Option<[u8; 2]>,
    length: u32,
    /// Where its value begins.
    value: usize,
}

impl Element {
    fn value_in<'a>(&self, bytes: &'a [u8]) -> Option<&'a [u8]> {
        bytes.get(self.value..)?.get(..self.length as usize)
    }
}

fn read_element(bytes: &[u8], at: usize, encoding: Encoding) -> Result<Element, Fault> {
    let &[a, b, c, d, e, f, g, h] =
        bytes.get(at..).and_then(|rest| rest.first_chunk()).ok_or(Fault::Short)?;
    let short = |pair| u16::from_le_bytes(from_lowest(pair, encoding.is_big_endian));
    let long = |four| u32::from_le_bytes(from_lowest(four, encoding.is_big_endian));
    let tag = u32::from(short([a, b])) << 16 | u32::from(short([c, d]));
    let is_delimiter = matches!(tag, ITEM | ITEM_END | SEQUENCE_END);
    let states = encoding.is_explicit && !is_delimiter && e.is_ascii_uppercase() && f.is_ascii_uppercase();
    if !states {
        return Ok(Element { tag, representation: None, length: long([e, f, g, h]), value: at + 8 });
    }
    let representation = Some([e, f]);
    if !LONG.contains(&&[e, f]) {
        return Ok(Element { tag, representation, length: u32::from(short([g, h])), value: at + 8 });
    }
    let &four = bytes.get(at + 8..).and_then(|rest| rest.first_chunk()).ok_or(Fault::Short)?;
    Ok(Element { tag, representation, length: long(four), value: at + 12 })
}

fn trimmed(value: &[u8]) -> String {
    String::from_utf8_lossy(value).trim_matches([' ', '\0']).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn element(tag: Tag, representation: &[u8; 2], value: &[u8]) -> Vec<u8> {
        let mut bytes = ((tag >> 16) as u16).to_le_bytes().to_vec();
        bytes.extend((tag as u16).to_le_bytes());
        bytes.extend(representation);
        bytes.extend((value.len() as u16).to_le_bytes());
        bytes.extend(value);
        bytes
    }

    /// A nesting that would overflow the stack of a reader that recurses.
    #[test]
    fn deep_nesting_is_an_error() {
        let mut bytes = element(MODALITY, b"CS", b"CT");
        for _ in 0..100_000 {
            bytes.extend(*b"\x08\x00\x40\x11SQ\x00\x00\xFF\xFF\xFF\xFF\xFE\xFF\x00\xE0\xFF\xFF\xFF\xFF");
        }
        let elements = read_elements(&bytes, 0, false);
        assert_eq!(elements.fault, Some(Fault::Malformed("its sequences nest too deep")));
        assert_eq!(elements.text(MODALITY).as_deref(), Some("CT"));
    }

    #[test]
    fn sequences_are_passed_over() {
        let inner = element(ROWS, b"US", &7_u16.to_le_bytes());
        let mut bytes = element(MODALITY, b"CS", b"CT");
        bytes.extend(*b"\x08\x00\x40\x11SQ\x00\x00\xFF\xFF\xFF\xFF\xFE\xFF\x00\xE0\xFF\xFF\xFF\xFF");
        bytes.extend(&inner);
        bytes.extend(*b"\xFE\xFF\x0D\xE0\x00\x00\x00\x00\xFE\xFF\xDD\xE0\x00\x00\x00\x00");
        let before = bytes.clone();
        bytes.extend(element(COLUMNS, b"US", &9_u16.to_le_bytes()));
        let elements = read_elements(&bytes, 0, false);
        assert_eq!((elements.fault, elements.short(ROWS), elements.short(COLUMNS)), (None, None, Some(9)));
        assert_eq!(read_elements(&before[..before.len() - 8], 0, false).fault, Some(Fault::Short));
    }
}
