//! The compressions of the JPEG family, behind a check of their own headers.
//!
//! **Input** one image's codestream and its declared size. **Output** its numbers.
//! **Steps** 1. the stream's own header: size, precision, one component, one scan; 2. the decoder.
//! **Guarantees** a stream that is larger than the DICOM header says never reaches a decoder, so that its memory is
//! bounded by the image; the decoders are Rust without `unsafe` and give the same numbers on every machine.
//! **Source** ITU-T T.81 annex B (JPEG), T.87 annex C (JPEG-LS), T.800 annex A (JPEG 2000).
//!
//! Why not `dicom-pixeldata`? It decodes JPEG 2000 by a C library turned into Rust word by word, `unsafe` throughout;
//! JPEG-LS needs a C++ library; and its adapters panic where a stream is larger than the header says (0.10.1).

use hayro_jpeg2000::{DecodeSettings, DecoderContext, Image};

const START: u8 = 0xD8;
const END: u8 = 0xD9;
const SCAN: u8 = 0xDA;
/// The frame of JPEG-LS.
const FRAME_LS: u8 = 0xF7;
/// The frames of JPEG that are read: baseline, sequential, lossless.
const FRAMES: [u8; 3] = [0xC0, 0xC1, 0xC3];
/// A codestream of JPEG 2000 begins with these bytes, in a file of its own format further on.
const JPEG_2000: [u8; 4] = [0xFF, 0x4F, 0xFF, 0x51];
const MAX_JPEG_2000_START: usize = 4096;
/// Precincts of fewer pixels a side (as a power of 2) would need more memory than the image.
const MIN_PRECINCT: u8 = 4;
/// Tiles of fewer pixels a side likewise.
const MIN_TILE: u64 = 32;

/// What the header of a JPEG or JPEG-LS stream says.
struct Frame {
    kind: u8,
    precision: u8,
    /// Where the stream ends.
    end: usize,
}

pub(super) fn jpeg(stream: &[u8], size: [usize; 2]) -> Result<Vec<i32>, String> {
    let frame = read_frame(stream, size)?;
    if !FRAMES.contains(&frame.kind) {
        return Err(
            "a kind of JPEG that espalier does not read (progressive, hierarchical or arithmetic)".to_owned()
        );
    }
    if frame.kind != 0xC3 && frame.precision != 8 {
        return Err(format!("lossy JPEG of {} bits, espalier reads 8", frame.precision));
    }
    let mut decoder = jpeg_decoder::Decoder::new(&stream[..frame.end]);
    let bytes = decoder.decode().map_err(|error| error.to_string())?;
    if frame.precision <= 8 {
        return Ok(bytes.into_iter().map(i32::from).collect());
    }
    Ok(bytes.as_chunks::<2>().0.iter().map(|&pair| i32::from(u16::from_ne_bytes(pair))).collect())
}

pub(super) fn jpeg_ls(stream: &[u8], size: [usize; 2]) -> Result<Vec<i32>, String> {
    let frame = read_frame(stream, size)?;
    if frame.kind != FRAME_LS {
        return Err("not a stream of JPEG-LS".to_owned());
    }
    let [width, height] = size.map(|extent| extent as u32);
    let (values, _, _) =
        jpegls::decode(&stream[..frame.end], width, height).map_err(|error| error.to_string())?;
    Ok(values.into_iter().map(i32::from).collect())
}

/// Reads the segments of a stream up to its end: one frame of the declared size, one component, one scan.
fn read_frame(stream: &[u8], [width, height]: [usize; 2]) -> Result<Frame, String> {
    if stream.get(..2) != Some(&[0xFF, START]) {
        return Err("the stream does not begin with a start marker".to_owned());
    }
    let (mut at, mut frame, mut n_scans) = (2, None, 0);
    while let Some(marker) = next_marker(stream, &mut at) {
        if marker == END {
            break;
        }
        let body = segment(stream, at).ok_or("a segment is cut short")?;
        let is_frame = matches!(marker, 0xC0..=0xCF | FRAME_LS) && !matches!(marker, 0xC4 | 0xC8 | 0xCC);
        if is_frame {
            let &[precision, h1, h2, w1, w2, n_components, ..] = body else {
                return Err("the frame's header is cut short".to_owned());
            };
            let found = [u16::from_be_bytes([w1, w2]), u16::from_be_bytes([h1, h2])].map(usize::from);
            if found != [width, height] || n_components != 1 || frame.is_some() {
                let [w, h] = found;
                return Err(format!(
                    "the stream is {w}x{h} of {n_components} components, the header says {width}x{height} of one"
                ));
            }
            if !(2..=16).contains(&precision) {
                return Err(format!("a precision of {precision} bits"));
            }
            frame = Some(Frame { kind: marker, precision, end: stream.len() });
        }
        at += body.len() + 2;
        if marker == SCAN {
            n_scans += 1;
            let shift = body.last().copied().unwrap_or(0) & 0x0F;
            let is_lossless_frame = frame.as_ref().is_some_and(|frame| matches!(frame.kind, 0xC3 | FRAME_LS));
            if n_scans > 1 || (shift > 0 && is_lossless_frame) {
                return Err("several scans, or a point transform".to_owned());
            }
        }
    }
    let frame = frame.filter(|_| n_scans == 1).ok_or("the stream has no frame or no scan")?;
    Ok(Frame { end: at.min(stream.len()), ..frame })
}

/// The next marker, past coded data, where 0xFF is followed by a stuffing byte or a restart.
fn next_marker(stream: &[u8], at: &mut usize) -> Option<u8> {
    loop {
        let skipped = stream.get(*at..)?.iter().position(|&byte| byte == 0xFF)?;
        let marker = *stream.get(*at + skipped + 1)?;
        *at += skipped + if marker == 0xFF { 1 } else { 2 };
        // In JPEG-LS the byte after 0xFF has its highest bit clear, in JPEG it is 0.
        if !matches!(marker, 0..0x80 | 0xD0..=0xD7 | 0xFF) {
            return Some(marker);
        }
    }
}

/// The body of a segment, without the two bytes of its length.
fn segment(stream: &[u8], at: usize) -> Option<&[u8]> {
    let length = usize::from(u16::from_be_bytes(*stream.get(at..)?.first_chunk()?));
    stream.get(at + 2..at + length.max(2))
}

pub(super) fn jpeg_2000(stream: &[u8], size: [usize; 2], is_signed: bool) -> Result<Vec<i32>, String> {
    let start = stream.windows(4).take(MAX_JPEG_2000_START).position(|four| four == JPEG_2000);
    let stream = &stream[start.ok_or("not a stream of JPEG 2000")?..];
    let header = check_jpeg_2000(stream, size)?;
    let settings = DecodeSettings { resolve_palette_indices: false, strict: true, target_resolution: None };
    let image = Image::new(stream, &settings).map_err(|error| error.to_string())?;
    let mut context = DecoderContext::default();
    let decoded = image.decode(&mut context).map_err(|error| error.to_string())?;
    let [component] = decoded.components() else { return Err("several components".to_owned()) };
    if component.samples().len() != size[0] * size[1] {
        return Err(format!("{} pixels expected, {} decoded", size[0] * size[1], component.samples().len()));
    }

    // The decoder adds half the range to signed numbers too. A stream that says unsigned where the header says signed
    // holds the bits of signed numbers, and the other way round.
    let half = 1_i32 << (header.precision - 1);
    let range = 2 * half;
    let value = |sample: &f32| {
        let stored = (sample + 0.5).floor() as i32 - if header.is_signed { half } else { 0 };
        match (is_signed, header.is_signed) {
            (true, true) => stored.clamp(-half, half - 1),
            (false, false) => stored.clamp(0, range - 1),
            (true, false) if stored >= half => stored.min(range - 1) - range,
            (true, false) => stored.max(0),
            (false, true) => stored.clamp(-half, half - 1) & (range - 1),
        }
    };
    Ok(component.samples().iter().map(value).collect())
}

/// What the header of a JPEG 2000 stream says.
struct Jpeg2000Header {
    precision: u32,
    is_signed: bool,
}

/// Checks size, components, tiles and precincts. Segments stand one after the other up to the first tile.
fn check_jpeg_2000(stream: &[u8], [width, height]: [usize; 2]) -> Result<Jpeg2000Header, String> {
    let size = segment(stream, 4).ok_or("its header is cut short")?;
    let long = |i: usize| {
        size.get(i..).and_then(|rest| rest.first_chunk()).map(|&four| u64::from(u32::from_be_bytes(four)))
    };
    let area: Option<Vec<u64>> = (0..8).map(|i| long(2 + 4 * i)).collect();
    let (Some(area), Some(&[0, 1, bits, 1, 1])) = (area, size.get(34..)) else {
        return Err("the stream is not of one whole component".to_owned());
    };
    let [x_end, y_end, x_start, y_start, tile_x, tile_y, ..] = area[..] else { return Err(String::new()) };
    if x_end.wrapping_sub(x_start) != width as u64 || y_end.wrapping_sub(y_start) != height as u64 {
        return Err(format!("the stream is not of {width}x{height} pixels, as the header says"));
    }
    let is_small = |tile: u64, extent: usize| tile < MIN_TILE.min(extent as u64);
    if is_small(tile_x, width) || is_small(tile_y, height) || x_end > 1 << 20 || y_end > 1 << 20 {
        return Err(format!("its tiles are {tile_x}x{tile_y} pixels"));
    }
    let precision = u32::from(bits & 0x7F) + 1;
    if precision > 16 {
        return Err(format!("a precision of {precision} bits"));
    }
    check_precincts(stream, 4 + 2 + size.len())?;
    Ok(Jpeg2000Header { precision, is_signed: bits & 0x80 != 0 })
}

/// Wherever coding styles stand, in the main header or in that of a part of a tile, precincts must not be tiny.
fn check_precincts(stream: &[u8], start: usize) -> Result<(), String> {
    const TILE_PART: [u8; 2] = [0xFF, 0x90];
    const DATA: [u8; 2] = [0xFF, 0x93];
    let mut at = start;
    // Where the part of a tile ends whose header is being read.
    let mut part_end = None;
    while let Some(marker) = stream.get(at..at + 2).filter(|marker| *marker != [0xFF, END]) {
        if marker == DATA {
            // Parts follow each other; one of length 0 goes on to the end.
            at = match part_end.take() {
                Some(end) if end > at => end,
                _ => break,
            };
            continue;
        }
        let body = segment(stream, at + 2).ok_or("a segment is cut short")?;
        if marker == TILE_PART {
            let length =
                body.get(2..).and_then(|rest| rest.first_chunk()).map(|&four| u32::from_be_bytes(four));
            let length = length.ok_or("the header of a tile is cut short")? as usize;
            part_end = (length > 0).then(|| at.saturating_add(length));
        }
        let is_tiny = |byte: &u8| (byte & 0x0F).min(byte >> 4) < MIN_PRECINCT;
        if precincts(marker, body).iter().any(is_tiny) {
            return Err("its precincts are tiny".to_owned());
        }
        at += 4 + body.len();
    }
    Ok(())
}

/// The sizes of precincts that a segment states, a byte for each resolution; none where it is no coding style, or states
/// none.
fn precincts<'a>(marker: &[u8], body: &'a [u8]) -> &'a [u8] {
    // Of all components: the style, four bytes, five; of one: its number, the style, five.
    let (style, first) = match marker {
        [0xFF, 0x52] => (0, 10),
        [0xFF, 0x53] => (1, 7),
        _ => return &[],
    };
    let has_precincts = body.get(style).is_some_and(|style| style & 1 == 1);
    body.get(first..).filter(|_| has_precincts).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn segment_of(marker: u8, body: &[u8]) -> Vec<u8> {
        let length = (body.len() as u16 + 2).to_be_bytes();
        [&[0xFF, marker], length.as_slice(), body].concat()
    }

    /// A part of a tile: its header with these segments, and four bytes of data.
    fn part(segments: &[Vec<u8>]) -> Vec<u8> {
        let rest = [segments.concat().as_slice(), &[0xFF, 0x93, 1, 2, 3, 4]].concat();
        let length = (rest.len() as u32 + 12).to_be_bytes();
        let body = [&[0, 0], length.as_slice(), &[0, 1]].concat();
        [segment_of(0x90, &body), rest].concat()
    }

    #[test]
    fn tiny_precincts_are_found_wherever_they_stand() {
        let style = |precinct: u8| segment_of(0x52, &[1, 0, 0, 1, 0, 1, 4, 4, 0, 0, precinct, precinct]);
        let of_component = |precinct: u8| segment_of(0x53, &[0, 1, 1, 4, 4, 0, 0, precinct, precinct]);
        let check =
            |parts: &[Vec<u8>]| check_precincts(&[&parts.concat(), &[0xFF, END][..]].concat(), 0).is_ok();
        assert!(check(&[style(0x88), part(&[]), part(&[style(0x77), of_component(0x66)])]));
        assert!(!check(&[style(0x80), part(&[])]));
        assert!(!check(&[style(0x88), of_component(0x08), part(&[])]));
        assert!(!check(&[style(0x88), part(&[style(0x11)])]));
        assert!(!check(&[style(0x88), part(&[]), part(&[of_component(0x11)])]));
        // Without the bit that says so, none are stated.
        assert!(check(&[segment_of(0x52, &[0, 0, 0, 1, 0, 1, 4, 4, 0, 0, 0, 0]), part(&[])]));
    }
}
