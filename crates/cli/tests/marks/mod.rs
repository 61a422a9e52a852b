//! Marks in bytes: as text, in other codings, packed, and packed inside of what is coded.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

use std::io::Read;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

/// A stream longer than this is looked into only so far.
const MOST_INFLATED: u64 = 1 << 24;
/// Shorter runs of the alphabet of base 64 are words.
const LEAST_CODED: usize = 32;
/// Packed in coded in packed, and so on.
const MOST_LAYERS: usize = 4;

/// Texts that must not be there.
pub(crate) struct Marks {
    /// By first byte: what to look for, and the text that it stands for.
    forms: Vec<Vec<(Vec<u8>, String)>>,
}

impl Marks {
    pub(crate) fn new(texts: &[&str]) -> Self {
        let mut by_first = vec![Vec::new(); 256];
        for text in texts {
            for form in forms(text) {
                by_first[usize::from(form[0])].push((form, (*text).to_owned()));
            }
        }
        Self { forms: by_first }
    }

    /// The texts that stand in the bytes of a file, or in anything that is packed or coded in it.
    pub(crate) fn found_in(&self, bytes: Vec<u8>) -> Vec<String> {
        let mut found = Vec::new();
        let mut layers = vec![(bytes, 0)];
        while let Some((bytes, depth)) = layers.pop() {
            self.look(&bytes, &mut found);
            if depth < MOST_LAYERS {
                layers.extend(unpacked(&bytes).into_iter().map(|inner| (inner, depth + 1)));
            }
        }
        found
    }

    fn look(&self, bytes: &[u8], found: &mut Vec<String>) {
        for (at, first) in bytes.iter().enumerate() {
            for (form, text) in &self.forms[usize::from(*first)] {
                if bytes[at..].starts_with(form) && !found.contains(text) {
                    found.push(text.clone());
                }
            }
        }
    }
}

/// A mark as it stands in text of one or two bytes a letter, in small letters, in hexadecimal digits, and in base 64 at each
/// of the three places in a group.
fn forms(mark: &str) -> Vec<Vec<u8>> {
    let wide = |of: fn(u16) -> [u8; 2]| mark.encode_utf16().flat_map(of).collect();
    let digits: String = mark.bytes().map(|byte| format!("{byte:02x}")).collect();
    let coded = (0..3).map(|before| {
        let bytes = [vec![0; before], mark.as_bytes().to_vec()].concat();
        let code = STANDARD.encode(&bytes).into_bytes();
        // Only the digits that no neighbour has a part in.
        code[(8 * before).div_ceil(6)..8 * bytes.len() / 6].to_vec()
    });
    let mut forms: Vec<Vec<u8>> = vec![
        mark.into(),
        mark.to_lowercase().into(),
        wide(u16::to_le_bytes),
        wide(u16::to_be_bytes),
        digits.to_uppercase().into(),
        digits.into(),
    ];
    forms.extend(coded);
    forms.dedup();
    forms
}

/// Everything that can be unpacked: gzip, streams of zlib as in PNG, PDF and EXR, and base 64 as in pages.
fn unpacked(bytes: &[u8]) -> Vec<Vec<u8>> {
    let mut inner = Vec::new();
    if bytes.starts_with(&[0x1F, 0x8B]) {
        let mut plain = Vec::new();
        flate2::read::MultiGzDecoder::new(bytes).read_to_end(&mut plain).expect("gzip");
        inner.push(plain);
    }
    let starts = bytes.windows(2).enumerate();
    for (at, _) in starts.filter(|(_, two)| matches!(two, [0x78, 1 | 0x5E | 0x9C | 0xDA])) {
        let mut plain = Vec::new();
        // What only looks like the beginning of a stream ends in an error, behind what it gave.
        let _ = flate2::read::ZlibDecoder::new(&bytes[at..]).take(MOST_INFLATED).read_to_end(&mut plain);
        inner.push(plain);
    }
    let is_digit = |byte: &u8| byte.is_ascii_alphanumeric() || matches!(byte, b'+' | b'/');
    let runs = bytes.chunk_by(|a, b| is_digit(a) == is_digit(b));
    for run in runs.filter(|run| run.len() >= LEAST_CODED && is_digit(&run[0])) {
        // A word of the alphabet may stand right before the code: all four beginnings.
        inner.extend((0..4).filter_map(|from| {
            let whole = (run.len() - from) / 4 * 4;
            STANDARD.decode(&run[from..from + whole]).ok()
        }));
    }
    inner.retain(|plain| plain.len() > 4);
    inner
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    const MARK: &str = "DOE^JANE";

    fn zlib(bytes: &[u8]) -> Vec<u8> {
        let mut writer = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
        writer.write_all(bytes).expect("to memory");
        writer.finish().expect("to memory")
    }

    fn gzip(bytes: &[u8]) -> Vec<u8> {
        let mut writer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
        writer.write_all(bytes).expect("to memory");
        writer.finish().expect("to memory")
    }

    #[test]
    fn a_mark_is_found_wherever_it_is_hidden() {
        let marks = Marks::new(&["SOMEBODY", MARK]);
        let holds = |bytes: Vec<u8>| marks.found_in(bytes) == [MARK];
        let plain =
            format!("nothing to see here, {MARK}, and nothing there, for as long as it takes").into_bytes();
        let address =
            |bytes: &[u8]| format!("<img src=\"data:image/png;base64,{}\">", STANDARD.encode(bytes));
        assert!(holds(plain.clone()) && holds(gzip(&plain)));
        assert!(holds([b"\x89PNG zTXt".to_vec(), zlib(&plain), vec![1, 2, 3]].concat()));
        for before in 0..3 {
            let moved = [vec![b'x'; before], plain.clone()].concat();
            assert!(holds(address(&moved).into_bytes()), "{before}");
            assert!(holds(address(&zlib(&moved)).into_bytes()), "{before}");
            assert!(holds(zlib(address(&zlib(&moved)).as_bytes())), "{before}");
            // Too short to be unpacked, but not to be seen.
            assert!(
                holds(STANDARD.encode([vec![b'x'; before], MARK.into()].concat()).into_bytes()),
                "{before}"
            );
        }
        assert!(holds(MARK.encode_utf16().flat_map(u16::to_be_bytes).collect()));
        assert!(holds(b"doe^jane".to_vec()) && holds(b"444f455e4a414e45".to_vec()));
        assert!(marks.found_in(b"DOE^JAN, Jane Doe".to_vec()).is_empty());
    }
}
