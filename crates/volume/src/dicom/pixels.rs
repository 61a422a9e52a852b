//! The stored numbers of one slice.
//!
//! **Input** a slice's file and how its pixels lie in it. **Output** one `i32` a pixel, x fastest.
//! **Steps** 1. the bytes: as they are, inflated, or the fragments of a compressed image put together; 2. decoded;
//! 3. the bits of the value cut out of its cell and its sign extended.
//! **Guarantees** as many numbers as the header declares, or an error; memory is a few times those numbers.
//! **Source** DICOM PS3.5 sections 8.1 (cells), A.4 (fragments).

use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

use espalier_model::bytes::from_lowest;
use flate2::read::DeflateDecoder;

use super::header::{FIRST_BYTES, StoredPixels};
use super::syntax::Syntax;
use super::{codec, element, rle};

/// A compressed image takes at most so many times its pixels' bytes, …
const MAX_EXPANSION: u64 = 4;
/// … and this much for what its format says of itself.
const MAX_OVERHEAD_BYTES: u64 = 64 << 10;

/// Reads and decodes one slice; the error says what is wrong with it.
pub(super) fn decode(path: &Path, stored: &StoredPixels, max_bytes: u64) -> Result<Vec<i32>, String> {
    if stored.syntax.is_native() {
        return Ok(cut_out(&cells(&native_bytes(path, stored)?, stored), stored));
    }
    decompress(&fragments(path, stored, max_bytes)?, stored)
}

/// The numbers of a compressed image.
fn decompress(stream: &[u8], stored: &StoredPixels) -> Result<Vec<i32>, String> {
    let cells = match stored.syntax {
        Syntax::Rle => rle::decode(stream, stored)?,
        Syntax::Jpeg { .. } => codec::jpeg(stream, stored.size)?,
        Syntax::JpegLs { .. } => codec::jpeg_ls(stream, stored.size)?,
        // Its numbers have a sign of their own and fill no cells.
        Syntax::Jpeg2000 { .. } => return codec::jpeg_2000(stream, stored.size, stored.is_signed),
        Syntax::Native { .. } | Syntax::Deflated => return Err("pixels that are not compressed".to_owned()),
        Syntax::Unknown { name } => return Err(name.to_owned()),
    };
    if cells.len() != stored.n_pixels() {
        return Err(format!("{} pixels expected, {} decoded", stored.n_pixels(), cells.len()));
    }
    Ok(cut_out(&cells, stored))
}

/// Whether two slices' files hold the same pixels in the same form.
pub(super) fn are_equal(a: (&Path, &StoredPixels), b: (&Path, &StoredPixels), max_bytes: u64) -> bool {
    let bytes = |(path, stored): (&Path, &StoredPixels)| {
        if stored.syntax.is_native() {
            native_bytes(path, stored)
        } else {
            fragments(path, stored, max_bytes)
        }
    };
    let form = |stored: &StoredPixels| {
        let StoredPixels { syntax, size, bits_allocated, bits_stored, low_bit, is_signed, .. } = *stored;
        (syntax, size, bits_allocated, bits_stored, low_bit, is_signed)
    };
    form(a.1) == form(b.1) && bytes(a).is_ok_and(|pixels| bytes(b) == Ok(pixels))
}

fn native_bytes(path: &Path, stored: &StoredPixels) -> Result<Vec<u8>, String> {
    let (start, n_bytes) = (stored.place.offset, stored.n_bytes());
    if stored.syntax == Syntax::Deflated {
        return inflated_bytes(path, start as u64, n_bytes).map_err(|error| error.to_string());
    }
    let mut file = File::open(path).map_err(|error| error.to_string())?;
    file.seek(SeekFrom::Start(start as u64)).map_err(|error| error.to_string())?;
    let mut bytes = Vec::new();
    file.take(n_bytes as u64).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    if bytes.len() < n_bytes {
        return Err(format!("{n_bytes} bytes expected, {} found", bytes.len()));
    }
    Ok(bytes)
}

/// Bytes of a deflated data set; nothing else of it is held.
fn inflated_bytes(path: &Path, start: u64, n_bytes: usize) -> std::io::Result<Vec<u8>> {
    let mut file = BufReader::new(File::open(path)?);
    let mut meta = Vec::new();
    (&mut file).take(FIRST_BYTES).read_to_end(&mut meta)?;
    let packed = meta.get(element::read_meta(&meta).end..).unwrap_or_default();
    let mut data_set = DeflateDecoder::new(packed.chain(file));
    std::io::copy(&mut (&mut data_set).take(start), &mut std::io::sink())?;
    let mut pixels = Vec::new();
    data_set.take(n_bytes as u64).read_to_end(&mut pixels)?;
    if pixels.len() < n_bytes {
        return Err(std::io::Error::other("the deflated pixels are cut short"));
    }
    Ok(pixels)
}

/// The fragments of a compressed image, put together; the table of offsets before them is passed over.
fn fragments(path: &Path, stored: &StoredPixels, max_bytes: u64) -> Result<Vec<u8>, String> {
    let mut file = BufReader::new(File::open(path).map_err(|error| error.to_string())?);
    file.seek(SeekFrom::Start(stored.place.offset as u64)).map_err(|error| error.to_string())?;
    let most = max_bytes.min((stored.n_bytes() as u64).saturating_mul(MAX_EXPANSION) + MAX_OVERHEAD_BYTES);
    let mut together = Vec::new();
    for index in 0_u64.. {
        let mut start = [0_u8; 8];
        // Some writers leave the last delimiter out.
        if file.read_exact(&mut start).is_err() || start[..4] != [0xFE, 0xFF, 0x00, 0xE0] {
            break;
        }
        let [.., a, b, c, d] = start;
        let length = u64::from(u32::from_le_bytes([a, b, c, d]));
        let mut item = (&mut file).take(length);
        if index == 0 {
            std::io::copy(&mut item, &mut std::io::sink()).map_err(|error| error.to_string())?;
            continue;
        }
        if together.len() as u64 + length > most {
            return Err("its fragments are longer than its pixels could be".to_owned());
        }
        if (item.read_to_end(&mut together).map_err(|error| error.to_string())? as u64) < length {
            return Err("its last fragment is cut short".to_owned());
        }
    }
    if together.is_empty() { Err("it has no fragment".to_owned()) } else { Ok(together) }
}

/// The cells of pixels that are not compressed.
fn cells(bytes: &[u8], stored: &StoredPixels) -> Vec<i32> {
    let is_big_endian = stored.syntax == Syntax::Native { is_big_endian: true };
    if stored.bits_allocated == 8 {
        let mut cells: Vec<i32> = bytes.iter().map(|&byte| i32::from(byte)).collect();
        if is_big_endian && stored.place.is_words {
            cells.as_chunks_mut::<2>().0.iter_mut().for_each(|pair| pair.reverse());
        }
        return cells;
    }
    let decode = |pair| i32::from(u16::from_le_bytes(from_lowest(pair, is_big_endian)));
    bytes.as_chunks::<2>().0.iter().map(|&pair| decode(pair)).collect()
}

/// The value in each cell: overlays may use the bits beside it.
fn cut_out(cells: &[i32], stored: &StoredPixels) -> Vec<i32> {
    let above = 32 - stored.bits_stored;
    let value = |cell: i32| {
        let raised = (cell.cast_unsigned() >> stored.low_bit) << above;
        if stored.is_signed { raised.cast_signed() >> above } else { (raised >> above).cast_signed() }
    };
    cells.iter().map(|&cell| value(cell)).collect()
}

#[cfg(test)]
#[allow(
    clippy::print_stdout,
    clippy::disallowed_methods,
    reason = "tests find their data through the environment"
)]
mod tests {
    use super::super::header::stored_in;
    use super::*;

    const N_MUTANTS: usize = 150;

    /// The sum of all numbers, and their sum by weights that tell their order.
    fn digest(values: &[i32]) -> (i64, i64) {
        let weighted = values.iter().enumerate().map(|(i, &value)| i64::from(value) * (i as i64 % 1009 + 1));
        (values.iter().map(|&value| i64::from(value)).sum(), weighted.sum())
    }

    fn decoded(name: &str) -> Option<Result<Vec<i32>, String>> {
        let Some(data) = std::env::var_os("ESPALIER_DATA") else {
            println!("skipped: ESPALIER_DATA not set");
            return None;
        };
        let path = Path::new(&data).join("bad/dicom").join(name);
        Some(stored_in(&path).map_err(|o| o.to_string()).and_then(|stored| decode(&path, &stored, 1 << 30)))
    }

    /// The same picture in every transfer syntax.
    #[test]
    fn syntaxes_agree() {
        let Some(original) = decoded("pydicom/MR_small.dcm") else { return };
        for kind in ["RLE", "bigendian", "expb", "implicit", "jp2klossless", "jpeg_ls_lossless", "padded"] {
            assert_eq!(decoded(&format!("pydicom/MR_small_{kind}.dcm")), Some(original.clone()), "{kind}");
        }
    }

    /// Digests of what SimpleITK 2 (GDCM) reads, undone its rescaling.
    #[test]
    fn decoders_equal_gdcm() {
        for (name, expected) in [
            ("pydicom/MR_small", (2_125_338, 1_083_392_662)),
            ("pydicom/CT_small", (14_826_310, 7_433_021_560)),
            ("pydicom/image_dfl", (33_322_688, 16_808_441_573)),
            ("pydicom/JPEG-LL", (3_596_452, 1_828_116_097)),
            ("pydicom/JPGLosslessP14SV1_1s_1f_8b", (13_572_107, 6_834_867_124)),
            ("pydicom/bad_sequence", (248_348_502, 125_043_688_366)),
            ("pydicom/J2K_pixelrep_mismatch", (-172_605_258, -87_102_521_748)),
            ("pydicom/explicit_VR-UN", (-175_887_460, -88_246_685_628)),
            ("slicethickness_empty_string", (4_626_321, 2_348_804_473)),
        ] {
            let Some(values) = decoded(&format!("{name}.dcm")) else { return };
            assert_eq!(values.as_deref().map(digest), Ok(expected), "{name}");
        }
        // With losses the last bit is the decoder's own: a mean difference below 0.02.
        for (name, expected) in [("pydicom/693_J2KI", -2_181_784), ("pydicom/JPEG2000", 3_527_976)] {
            let Some(Ok(values)) = decoded(&format!("{name}.dcm")) else { return };
            let off = digest(&values).0 - expected;
            assert!(off.unsigned_abs() < values.len() as u64 / 50, "{name} {off}");
        }
        let refused = decoded("pydicom/JPEG-lossy.dcm");
        assert_eq!(refused, Some(Err("lossy JPEG of 12 bits, espalier reads 8".to_owned())));
    }

    /// Mutants of compressed pixels: none may panic, take long, or give more or fewer pixels than declared.
    #[test]
    fn mutants_never_panic() {
        use espalier_geom::random::{Purpose, Stream};
        let Some(data) = std::env::var_os("ESPALIER_DATA") else { return };
        let mut stream = Stream::new(31, Purpose::Test, 0, 0);
        for name in ["MR_small_RLE", "MR_small_jp2klossless", "MR_small_jpeg_ls_lossless", "JPEG-LL"] {
            let path = Path::new(&data).join(format!("bad/dicom/pydicom/{name}.dcm"));
            let stored = stored_in(&path).expect("pixels");
            let original = fragments(&path, &stored, 1 << 20).expect("fragments");
            for _ in 0..N_MUTANTS {
                let mut bytes = original.clone();
                for _ in 0..1 + stream.below(3) {
                    let reach = if stream.below(2) == 0 { bytes.len().min(120) } else { bytes.len() };
                    let at = stream.below(reach as u32) as usize;
                    match stream.below(6) {
                        0 => bytes.truncate(at.max(8)),
                        1 => bytes[at] ^= 1 << stream.below(8),
                        2 => bytes[at] = 0xFF,
                        _ => bytes[at] = stream.next_u32() as u8,
                    }
                }
                let decoded = decompress(&bytes, &stored);
                assert!(decoded.is_err() || decoded.is_ok_and(|values| values.len() == stored.n_pixels()));
            }
        }
    }
}
