//! An 8-bit RGB picture as PNG, packed by all threads.
//!
//! **Input** rows of RGBA bytes, all opaque. **Output** a PNG file.
//! **Notation** a strip is [`STRIP`] rows. **Steps** 1. Each row takes the filter that leaves the smallest sum of
//! absolute bytes, as the PNG specification advises. 2. Each strip is deflated by itself and ends on a whole byte
//! (a sync flush), so that strips put together are one deflate stream. 3. Checksums of the strips are combined.
//! **Guarantees** the same bytes for any number of threads. No time, no name, no other chunk than the image.
//! **Source** PNG, third edition, sections 5, 9 and 10; RFC 1950 for Adler-32.
//! **Why not a library** encoders pack with one thread: 4,096² pixels take over a second. The file around the stream
//! is three chunks.
//! **Cost** O(pixels) time; the file, and a strip for each thread.

use std::collections::BTreeMap;

use flate2::{Compress, Compression, FlushCompress, Status};
use rayon::prelude::*;

/// Rows that are packed together: a megabyte on a large page, so that starting anew costs nothing.
const STRIP: usize = 64;
/// Deflate's effort: one step more takes half as long again and saves 2 % of the airway's picture.
const LEVEL: u32 = 5;
/// The modulus of Adler-32.
const ADLER: u32 = 65_521;

/// Packs `pixels` (RGBA, rows from the top) of a picture `width` pixels wide.
pub(crate) fn encode(pixels: &[u8], width: u32, height: u32) -> Vec<u8> {
    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut header = Vec::with_capacity(13);
    header.extend(width.to_be_bytes());
    header.extend(height.to_be_bytes());
    // 8 bits, RGB, deflate, adaptive filters, not interlaced.
    header.extend([8, 2, 0, 0, 0]);
    chunk(&mut file, *b"IHDR", &header);
    for piece in stream(pixels, width, height) {
        chunk(&mut file, *b"IDAT", &piece);
    }
    chunk(&mut file, *b"IEND", &[]);
    file
}

/// Packs a small picture with at most 256 colours: pixels of like colour (the same upper four bits of each part) share their
/// mean, and those that are left over when 256 are taken have the nearest. A third of the bytes of [`encode`].
pub(crate) fn encode_in_few_colors(pixels: &[u8], width: u32, height: u32) -> Vec<u8> {
    let (palette, indices) = few_colors(pixels);
    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut header = Vec::with_capacity(13);
    header.extend(width.to_be_bytes());
    header.extend(height.to_be_bytes());
    // 8 bits, indexed, deflate, adaptive filters, not interlaced.
    header.extend([8, 3, 0, 0, 0]);
    chunk(&mut file, *b"IHDR", &header);
    chunk(&mut file, *b"PLTE", palette.as_flattened());
    // Indices are no amounts: no filter helps.
    let rows = indices.chunks((width as usize).max(1));
    let plain: Vec<u8> = rows.flat_map(|row| std::iter::once(0).chain(row.iter().copied())).collect();
    let stream = [vec![0x78, 0x5e], deflate(&plain, true), adler(&plain).to_be_bytes().to_vec()];
    chunk(&mut file, *b"IDAT", &stream.concat());
    chunk(&mut file, *b"IEND", &[]);
    file
}

/// At most 256 colours, and which of them each pixel has.
fn few_colors(pixels: &[u8]) -> (Vec<[u8; 3]>, Vec<u8>) {
    let key = |rgba: &[u8]| [rgba[0] >> 4, rgba[1] >> 4, rgba[2] >> 4];
    let mut sums: BTreeMap<[u8; 3], [u64; 4]> = BTreeMap::new();
    for rgba in pixels.chunks_exact(4) {
        let sum = sums.entry(key(rgba)).or_default();
        (0..3).for_each(|part| sum[part] += u64::from(rgba[part]));
        sum[3] += 1;
    }
    let mut by_count: Vec<([u8; 3], [u64; 4])> = sums.into_iter().collect();
    by_count.sort_by_key(|(key, [.., n])| (std::cmp::Reverse(*n), *key));
    let mean = |[r, g, b, n]: [u64; 4]| [r, g, b].map(|sum| ((sum + n / 2) / n) as u8);
    let palette: Vec<[u8; 3]> = by_count.iter().take(256).map(|(_, sum)| mean(*sum)).collect();
    let nearest = |color: [u8; 3]| {
        let off = |other: &[u8; 3]| -> u32 {
            color.iter().zip(other).map(|(a, b)| u32::from(a.abs_diff(*b)).pow(2)).sum()
        };
        palette.iter().enumerate().min_by_key(|(_, other)| off(other)).map_or(0, |(index, _)| index)
    };
    let index_of: BTreeMap<[u8; 3], u8> = by_count
        .iter()
        .enumerate()
        .map(|(rank, (key, sum))| (*key, if rank < 256 { rank } else { nearest(mean(*sum)) } as u8))
        .collect();
    let index = |rgba: &[u8]| index_of.get(&key(rgba)).copied().unwrap_or(0);
    let indices = pixels.chunks_exact(4).map(index).collect();
    (palette, indices)
}

/// The zlib stream of a PNG, in pieces.
pub(crate) fn stream(pixels: &[u8], width: u32, height: u32) -> Vec<Vec<u8>> {
    let stride = 4 * width as usize;
    let n_strips = (height as usize).div_ceil(STRIP).max(1);
    let strips: Vec<Strip> = (0..n_strips)
        .into_par_iter()
        .map(|strip| Strip::pack(pixels, stride, strip * STRIP, strip + 1 == n_strips))
        .collect();
    let adler = strips.iter().fold(1, |adler, strip| adler_of_both(adler, strip.adler, strip.n_bytes));
    let mut pieces = vec![vec![0x78, 0x5e]];
    pieces.extend(strips.into_iter().map(|strip| strip.deflated));
    pieces.push(adler.to_be_bytes().to_vec());
    pieces
}

fn chunk(file: &mut Vec<u8>, name: [u8; 4], data: &[u8]) {
    // Strips have fewer rows than would overflow this.
    file.extend((data.len() as u32).to_be_bytes());
    let start = file.len();
    file.extend(name);
    file.extend(data);
    let checksum = crc32fast::hash(&file[start..]);
    file.extend(checksum.to_be_bytes());
}

/// A strip of rows, packed.
struct Strip {
    deflated: Vec<u8>,
    n_bytes: usize,
    adler: u32,
}

impl Strip {
    fn pack(pixels: &[u8], stride: usize, first: usize, is_last: bool) -> Self {
        let rows: Vec<&[u8]> = pixels.chunks_exact(stride).skip(first).take(STRIP).collect();
        let mut above = vec![0; stride / 4 * 3];
        if let Some(before) = first.checked_sub(1) {
            take_rgb(&pixels[before * stride..(before + 1) * stride], &mut above);
        }
        let (mut row, mut filtered) = (above.clone(), Vec::with_capacity(rows.len() * (above.len() + 1)));
        let mut tries = [const { Vec::new() }; N_FILTERS];
        for rgba in rows {
            take_rgb(rgba, &mut row);
            filter(&row, &above, &mut tries, &mut filtered);
            std::mem::swap(&mut row, &mut above);
        }
        Self { deflated: deflate(&filtered, is_last), n_bytes: filtered.len(), adler: adler(&filtered) }
    }
}

fn take_rgb(rgba: &[u8], row: &mut [u8]) {
    for (rgb, rgba) in row.chunks_exact_mut(3).zip(rgba.chunks_exact(4)) {
        rgb.copy_from_slice(&rgba[..3]);
    }
}

/// The filters that are tried: Sub, Up, Average, Paeth. No filter at all helps only where colours are counted.
const N_FILTERS: usize = 4;

/// Appends the best filter's number and bytes.
fn filter(row: &[u8], above: &[u8], tries: &mut [Vec<u8>; N_FILTERS], out: &mut Vec<u8>) {
    if row == above {
        // Paper, mostly: nothing can be smaller than zeros.
        out.push(2);
        out.resize(out.len() + row.len(), 0);
        return;
    }
    let (left, above_left) = ([&[0; 3], row].concat(), [&[0; 3], above].concat());
    let places = || row.iter().zip(above).zip(left.iter().zip(&above_left));
    for (kind, bytes) in tries.iter_mut().enumerate() {
        bytes.clear();
        match kind {
            0 => bytes.extend(places().map(|((x, _), (a, _))| x.wrapping_sub(*a))),
            1 => bytes.extend(places().map(|((x, b), _)| x.wrapping_sub(*b))),
            2 => bytes.extend(
                places().map(|((x, b), (a, _))| x.wrapping_sub(((u16::from(*a) + u16::from(*b)) / 2) as u8)),
            ),
            _ => bytes.extend(places().map(|((x, b), (a, c))| x.wrapping_sub(paeth(*a, *b, *c)))),
        }
    }
    let size =
        |bytes: &Vec<u8>| bytes.iter().map(|&byte| u32::from((byte as i8).unsigned_abs())).sum::<u32>();
    let best = tries.iter().enumerate().min_by_key(|(_, bytes)| size(bytes));
    if let Some((kind, bytes)) = best {
        out.push(kind as u8 + 1);
        out.extend(bytes);
    }
}

/// The neighbour nearest to left + above − above left.
fn paeth(left: u8, above: u8, above_left: u8) -> u8 {
    let [a, b, c] = [left, above, above_left].map(i16::from);
    let [to_a, to_b, to_c] = [(b - c).abs(), (a - c).abs(), (a + b - 2 * c).abs()];
    if to_a <= to_b && to_a <= to_c {
        left
    } else if to_b <= to_c {
        above
    } else {
        above_left
    }
}

/// A piece of a deflate stream, which ends on a whole byte; the last ends the stream.
fn deflate(bytes: &[u8], is_last: bool) -> Vec<u8> {
    let mut packer = Compress::new(Compression::new(LEVEL), false);
    let flush = if is_last { FlushCompress::Finish } else { FlushCompress::Sync };
    let mut out = Vec::with_capacity(bytes.len() / 8 + 64);
    loop {
        let consumed = packer.total_in() as usize;
        // Packing into memory has no errors but a full buffer, which grows.
        let status = packer.compress_vec(&bytes[consumed.min(bytes.len())..], &mut out, flush);
        let is_done = match status {
            Ok(Status::StreamEnd) => true,
            Ok(_) => !is_last && packer.total_in() as usize == bytes.len() && out.len() < out.capacity(),
            Err(_) => false,
        };
        if is_done {
            return out;
        }
        out.reserve(out.capacity().max(64));
    }
}

fn adler(bytes: &[u8]) -> u32 {
    let (mut a, mut b) = (1_u32, 0_u32);
    // The most bytes whose sums stay below 2³².
    for part in bytes.chunks(5552) {
        for &byte in part {
            a += u32::from(byte);
            b += a;
        }
        (a, b) = (a % ADLER, b % ADLER);
    }
    (b << 16) | a
}

/// The checksum of two pieces put together, the second `n_second` bytes long.
fn adler_of_both(first: u32, second: u32, n_second: usize) -> u32 {
    let n = (n_second % ADLER as usize) as u32;
    let ([a1, b1], [a2, b2]) = ([first & 0xffff, first >> 16], [second & 0xffff, second >> 16]);
    let a = (a1 + a2 + ADLER - 1) % ADLER;
    // Every byte of the second piece adds the first's a, less the 1 that both began with.
    let carried = (u64::from(n) * u64::from(a1 + ADLER - 1) % u64::from(ADLER)) as u32;
    let b = (b1 + b2 + carried) % ADLER;
    (b << 16) | a
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checksums_of_pieces_combine() {
        let bytes: Vec<u8> = (0..200_000_u64).map(|i| ((i * i) >> 3) as u8).collect();
        for cut in [0, 1, 5552, 65_521, 150_000, 200_000] {
            let (first, second) = bytes.split_at(cut);
            assert_eq!(adler_of_both(adler(first), adler(second), second.len()), adler(&bytes));
        }
        // The example of RFC 1950's own implementation.
        assert_eq!(adler(b"Wikipedia"), 0x11E6_0398);
    }

    #[test]
    fn another_decoder_reads_what_was_drawn() {
        for (width, height) in [(1, 1), (5, 3), (33, 64), (70, 129), (300, 200)] {
            let noise = |i: usize| [i % 7 * 30, (i * i) >> 4, i / width % 5, 0].map(|part| part as u8);
            let mut pixels: Vec<u8> = (0..width * height).flat_map(noise).collect();
            pixels.chunks_exact_mut(4).for_each(|pixel| pixel[3] = 255);
            let file = encode(&pixels, width as u32, height as u32);
            let read = image::load_from_memory(&file).expect("a PNG").to_rgba8();
            assert_eq!(read.dimensions(), (width as u32, height as u32));
            assert!(read.as_raw() == &pixels, "{width} × {height}");
        }
    }
}
