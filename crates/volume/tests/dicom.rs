//! DICOM series made here: order, several series, duplicates, gaps, tilt, scaling, padding, and hostile bytes.
#![allow(clippy::expect_used, clippy::panic, reason = "this is how a test speaks")]

mod slices;

use espalier_geom::random::{Purpose, Stream};
use espalier_model::{Diagnose, Volume};
use espalier_volume::{DicomError, Error, Loaded, ReadError, ReadOptions, files, read, read_box};
use glam::DVec3;
use slices::{Slice, stack, write};

fn scratch() -> tempfile::TempDir {
    tempfile::tempdir().expect("a folder for temporary files")
}

fn read_slices(slices: &[Slice], options: &ReadOptions) -> Result<Loaded, Error> {
    let folder = scratch();
    write(folder.path(), slices, |index| format!("{index}.dcm"));
    read(folder.path(), options)
}

fn loaded(slices: &[Slice]) -> Loaded {
    read_slices(slices, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

fn dicom_error(result: Result<Loaded, Error>) -> DicomError {
    match result {
        Err(Error::Read { problem: ReadError::Dicom(error), .. }) => *error,
        Err(error) => panic!("{error}"),
        Ok(_) => panic!("it was read"),
    }
}

fn code_of(slices: &[Slice]) -> &'static str {
    dicom_error(read_slices(slices, &ReadOptions::default())).code()
}

const RESAMPLE: ReadOptions = ReadOptions {
    max_bytes: 4 << 30,
    volume_index: None,
    assume_space: None,
    unit_mm: None,
    strict: false,
    series: None,
    resample: true,
};

fn value_at(volume: &Volume, [x, y, z]: [f64; 3]) -> f64 {
    let voxel = volume.grid().voxel_from_world().transform_point3(DVec3::new(x, y, z));
    let nearest = volume.grid().voxel_at(voxel).expect("inside");
    assert!(
        (voxel - DVec3::from_array(nearest.map(|v| v as f64))).length() < 1e-4,
        "{voxel} is between voxels"
    );
    volume.value(volume.grid().index(nearest))
}

/// File names, their order, and other files do not matter; positions do, and thickness does not.
#[test]
fn slices_in_any_order() {
    let folder = scratch();
    let heights = [7.5, -2.5, 2.5, 0.0, 5.0];
    let paths =
        write(folder.path(), &stack(&heights), |index| ["x", "b.dcm", "0", "IM.1.2", "zz"][index].to_owned());
    std::fs::write(folder.path().join("notes.txt"), "nothing").expect("writable");
    std::fs::write(folder.path().join("empty"), "").expect("writable");
    std::fs::create_dir(folder.path().join("more")).expect("writable");
    let localizer = Slice { series: 1, orientation: [0.0, 1.0, 0.0, 0.0, 0.0, -1.0], ..Slice::at(0.0) };
    let localizer = localizer.with(0x0008_0008, "CS", b"ORIGINAL\\PRIMARY\\LOCALIZER");
    write(&folder.path().join("more"), &[localizer], |_| "scout".to_owned());

    let loaded = read(folder.path(), &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    let grid = loaded.volume.grid();
    assert_eq!((grid.shape(), grid.orientation().as_str()), ([6, 5, 5], "LPS"));
    assert!((grid.spacing_mm() - DVec3::new(0.75, 0.5, 2.5)).length() < 1e-6);
    assert_eq!(loaded.report.get("dicom_other_series"), Some(1.0));
    assert_eq!(loaded.report.get("files_not_dicom"), Some(2.0));
    assert!(loaded.report.warnings.is_empty());
    // The first pixel of the slice at 5 mm lies at LPS (-20, -30, 5), which is RAS (20, 30, 5).
    assert_eq!(value_at(&loaded.volume, [20.0, 30.0, 5.0]), -500.0);
    assert_eq!(value_at(&loaded.volume, [20.0 - 3.0 * 0.75, 30.0 - 2.0 * 0.5, -2.5]), -1000.0 - 300.0 + 23.0);

    let by_position = [1, 3, 2, 4, 0].map(|index: usize| paths[index].clone());
    assert_eq!(files(folder.path(), &ReadOptions::default()).expect("readable"), by_position);
    // One file stands for its series.
    let by_file = read(&paths[2], &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(by_file.volume, loaded.volume);
}

#[test]
fn several_series_are_listed() {
    let mut both = stack(&[0.0, 1.0, 2.0]);
    both.extend(stack(&[0.0, 3.0, 6.0, 9.0]).into_iter().map(|slice| Slice {
        series: 8,
        intercept: 0.0,
        ..slice
    }));
    let error = dicom_error(read_slices(&both, &ReadOptions::default()));
    assert_eq!((error.code(), error.class().exit_code()), ("E-DICOM-SERIES", 2));
    let hint = error.hint();
    assert!(hint.contains("--series 1: number 3, CT, 3 images of 6x5, 0.750 x 0.500 x 1.000 mm"), "{hint}");
    assert!(hint.contains("--series 2: number 8, CT, 4 images"), "{hint}");
    assert!(slices::SECRETS.iter().all(|secret| !hint.contains(secret)));

    let second =
        read_slices(&both, &ReadOptions { series: Some(2), ..ReadOptions::default() }).expect("chosen");
    assert_eq!(second.volume.grid().shape(), [6, 5, 4]);
    let none = dicom_error(read_slices(&both, &ReadOptions { series: Some(3), ..ReadOptions::default() }));
    assert!(matches!(none, DicomError::NoSuchSeries { index: 3, .. }));
}

#[test]
fn one_place_several_images() {
    let same = stack(&[0.0, 1.0, 1.0, 2.0]);
    let merged = loaded(&same);
    assert_eq!(merged.volume.grid().shape(), [6, 5, 3]);
    assert_eq!(merged.report.warnings[0].code, "W-DICOM-DUPLICATE");

    let mut differing = same;
    differing[2].values[7] += 1;
    assert_eq!(code_of(&differing), "E-DICOM-DUPLICATE");

    // Two times of one scan are two series.
    let at = |time: &'static [u8]| {
        stack(&[0.0, 1.0, 2.0]).into_iter().map(move |s| s.with(0x0020_0100, "IS", time))
    };
    let mut times: Vec<Slice> = at(b"1").chain(at(b"2")).collect();
    times[4].values[0] = 77;
    let error = dicom_error(read_slices(&times, &ReadOptions::default()));
    assert!(error.hint().contains("(time 2)"), "{}", error.hint());
    let second =
        read_slices(&times, &ReadOptions { series: Some(2), ..ReadOptions::default() }).expect("chosen");
    assert_eq!(second.volume.value(30), 77.0 - 1000.0);
}

#[test]
fn gaps_and_uneven_distances() {
    let gap = stack(&[0.0, 2.0, 4.0, 10.0, 12.0, 14.0]);
    let error = dicom_error(read_slices(&gap, &ReadOptions::default()));
    assert_eq!(error.code(), "E-DICOM-GAP");
    assert!(error.to_string().contains("2 slices are missing after slice 3 at 4.00 mm"), "{error}");
    let filled = read_slices(&gap, &RESAMPLE).expect("resampled");
    assert_eq!(filled.volume.grid().shape(), [6, 5, 8]);
    assert_eq!(filled.report.warnings[0].code, "W-DICOM-RESAMPLED");
    // How much was made up stands beside it.
    let message = &filled.report.warnings[0].message;
    assert!(message.contains("2 slices are missing after slice 3"), "{message}");
    assert!(message.contains("2 of 8 planes lie between slices, up to 6.00 mm apart"), "{message}");
    let count = |name: &str| filled.report.get(name);
    assert_eq!((count("dicom_missing_slices"), count("dicom_planes_between_slices")), (Some(2.0), Some(2.0)));
    assert_eq!((count("dicom_widest_gap_mm"), count("dicom_voxels_outside_slices")), (Some(6.0), Some(0.0)));
    // Values grow by 100 a mm of height, so between slices too.
    assert_eq!(value_at(&filled.volume, [20.0, 30.0, 8.0]), -200.0);

    let uneven = stack(&[0.0, 2.0, 4.0, 7.0, 10.0, 13.0]);
    let error = dicom_error(read_slices(&uneven, &ReadOptions::default()));
    assert_eq!(error.code(), "E-DICOM-SPACING");
    assert!(error.to_string().contains("from 2.000 to 3.000 mm"), "{error}");

    // Positions written with one decimal are even: 0.625 mm apart.
    let rounded: Vec<f64> = (0..40).map(|i| (f64::from(i) * 6.25).round() / 10.0).collect();
    assert!((loaded(&stack(&rounded)).volume.grid().spacing_mm().z - 0.625).abs() < 0.002);
    assert_eq!(code_of(&stack(&[0.0])), "E-DICOM-SINGLE");
}

/// Few values, none below 0 and no rescaling, as scans of 8 bits have: what lies between slices is told by the modality.
#[test]
fn few_values_of_a_scanner_are_no_labels() {
    let slices = |modality: &'static str| -> Vec<Slice> {
        let slice = |i: u32| {
            let mut slice = Slice::at([0.0, 2.0, 4.0, 8.0][i as usize]);
            (slice.modality, slice.intercept) = (modality, 0.0);
            slice.values = vec![10 * i as i16; 30];
            slice
        };
        (0..4).map(slice).collect()
    };
    let middle = |modality| {
        let volume = read_slices(&slices(modality), &RESAMPLE).expect("resampled").volume;
        volume.value(volume.grid().index([2, 2, 3]))
    };
    assert_eq!((middle("CT"), middle("MR")), (25.0, 25.0));
    assert!([20.0, 30.0].contains(&middle("SEG")) && [20.0, 30.0].contains(&middle("OT")));
}

/// A tilted gantry: where the value tells the place, resampling must put it there.
#[test]
fn tilt_is_refused_or_resampled() {
    let size = [24, 30];
    let tilt = |z: f64| {
        let value = |i: usize| {
            let [x, y] = [(i % 24) as f64, (i / 24) as f64];
            // The value is linear in the place: 2 x + 20 y + 8 z in mm.
            let [along, down] = [(-20.0 + 0.75 * x), (-30.0 + 0.2 * z + 0.5 * y)];
            (2.0 * along + 20.0 * down + 8.0 * z).round() as i16
        };
        let values = (0..720).map(value).collect();
        Slice { position: [-20.0, -30.0 + 0.2 * z, z], size, values, intercept: 0.0, ..Slice::at(z) }
    };
    let slices: Vec<Slice> = (0..6).map(|i| tilt(f64::from(i) * 2.5)).collect();
    let error = dicom_error(read_slices(&slices, &ReadOptions::default()));
    assert_eq!(error.code(), "E-DICOM-TILT");
    assert!(error.to_string().contains("tilted by 11.3 degrees"), "{error}");
    assert!(error.to_string().contains("0.500 mm aside"), "{error}");

    let resampled = read_slices(&slices, &RESAMPLE).expect("resampled");
    let grid = resampled.volume.grid();
    // Slices are moved by a whole row each, so five rows are added and no value is blended.
    assert_eq!(grid.shape(), [24, 35, 6]);
    let lowest = -1.0 + resampled.volume.map_values(|v| v).into_iter().fold(f64::INFINITY, f64::min);
    let mut n_outside = 0;
    for index in 0..grid.n_voxels() {
        let [x, y, z] = grid.voxel(index);
        let ras = grid.world_from_voxel().transform_point3(DVec3::new(x as f64, y as f64, z as f64));
        let expected = 2.0 * -ras.x + 20.0 * -ras.y + 8.0 * ras.z;
        let found = resampled.volume.value(index);
        if (z..z + 30).contains(&y) {
            assert!((found - expected).abs() < 0.51, "{found} at {ras}, expected {expected}");
        } else {
            n_outside += 1;
            assert!(found < lowest + 1.5, "{found}");
        }
    }
    assert_eq!(n_outside, 24 * 5 * 6);
    assert_eq!(resampled.report.get("dicom_voxels_outside_slices"), Some(f64::from(24 * 5 * 6)));
    assert!((resampled.report.get("dicom_tilt_deg").expect("a tilt") - 11.31).abs() < 0.01);
}

#[test]
fn scaling_and_padding() {
    let mut slices = stack(&[0.0, 1.0, 2.0]);
    slices[1].slope = 2.0;
    slices[2].intercept = 24.0;
    let each = loaded(&slices);
    assert_eq!([0, 30, 60].map(|i| each.volume.value(i)), [-1000.0, 200.0 - 1000.0, 200.0 + 24.0]);
    assert_eq!(each.report.get("dicom_scalings"), Some(3.0));

    // Scaling that cannot be read is no scaling of 1 and 0.
    for (element, text) in [(0x0028_1053, b"1,5 "), (0x0028_1052, b"1\\2 "), (0x0028_1053, b"inf ")] {
        let slices = stack(&[0.0, 1.0]).into_iter().map(|slice| slice.with(element, "DS", text));
        assert_eq!(code_of(&slices.collect::<Vec<_>>()), "E-DICOM-FIELD");
    }

    let mut padded = stack(&[0.0, 1.0]);
    padded[1].values[3] = -2000;
    let padded: Vec<Slice> =
        padded.into_iter().map(|s| s.with(0x0028_0120, "SS", &(-2000_i16).to_le_bytes())).collect();
    let read = loaded(&padded);
    assert_eq!(read.volume.value(33), -1000.0, "the smallest value that is no padding");
    assert_eq!(read.report.get("dicom_padding_voxels"), Some(1.0));

    // Overlays in the bits above, 12 bits stored, unsigned.
    let mut overlaid = stack(&[0.0, 1.0]);
    overlaid[0].values[2] |= 0x7000;
    let short = |v: u16| v.to_le_bytes();
    let overlaid: Vec<Slice> = overlaid
        .into_iter()
        .map(|s| {
            s.with(0x0028_0101, "US", &short(12)).with(0x0028_0102, "US", &short(11)).with(
                0x0028_0103,
                "US",
                &short(0),
            )
        })
        .collect();
    assert_eq!(loaded(&overlaid).volume.value(2), 2.0 - 1000.0);
}

#[test]
fn what_is_refused() {
    let all = |tag: u32, representation: &'static str, value: &[u8]| {
        code_of(
            &stack(&[0.0, 1.0]).into_iter().map(|s| s.with(tag, representation, value)).collect::<Vec<_>>(),
        )
    };
    assert_eq!(all(0x0028_0004, "CS", b"RGB"), "E-DICOM-COLOR");
    assert_eq!(all(0x0028_0008, "IS", b"12"), "E-DICOM-MULTIFRAME");
    assert_eq!(all(0x0020_0032, "DS", b"1\\2"), "E-DICOM-FIELD");
    assert_eq!(all(0x0020_0032, "DS", b"1\\2\\nan"), "E-DICOM-FIELD");
    assert_eq!(all(0x0020_0037, "DS", b"1\\0\\0\\1\\0\\0"), "E-DICOM-FIELD");
    assert_eq!(all(0x0028_0030, "DS", b"0\\0"), "E-DICOM-FIELD");
    assert_eq!(all(0x0028_0100, "US", &[32, 0]), "E-DICOM-BITS");
    assert_eq!(all(0x0028_0010, "US", &[0xFF, 0xFF]), "E-DICOM-TRUNCATED");

    // A damaged slice of the series is never left out in silence.
    let folder = scratch();
    let paths = write(folder.path(), &stack(&[0.0, 1.0, 2.0]), |index| index.to_string());
    let bytes = std::fs::read(&paths[2]).expect("readable");
    std::fs::write(&paths[2], &bytes[..bytes.len() - 4]).expect("writable");
    let error = dicom_error(read(folder.path(), &ReadOptions::default()));
    assert!(error.to_string().contains("60 bytes of pixels expected, 56 found (in 2)"), "{error}");
    // One of another series is.
    std::fs::write(&paths[2], &Slice { series: 9, ..Slice::at(5.0) }.bytes()[..660]).expect("writable");
    assert!(read(folder.path(), &ReadOptions::default()).is_ok());

    let limit = ReadOptions { max_bytes: 1000, ..ReadOptions::default() };
    let error = read_slices(&stack(&[0.0, 1.0]), &limit).expect_err("too large");
    assert_eq!((error.code(), error.class().exit_code()), ("E-VOLUME-TOO-LARGE", 5));
    let empty = scratch();
    assert_eq!(dicom_error(read(empty.path(), &ReadOptions::default())).code(), "E-DICOM-NONE");
}

/// The data set of a slice under another transfer syntax, with these pixels.
fn recoded(syntax: &str, pixels: &[u8]) -> Vec<u8> {
    let plain = Slice::at(0.0).bytes();
    let n_pixel_bytes = 8 + 4 + 60;
    // Behind the preamble, its mark, and the element of the syntax of 8 and 20 bytes.
    let data_set = &plain[128 + 4 + 28..plain.len() - n_pixel_bytes];
    let meta = slices::element(0x0002_0010, "UI", syntax.as_bytes().to_vec());
    let tag = [0xE0, 0x7F, 0x10, 0x00, b'O', b'B', 0, 0, 0xFF, 0xFF, 0xFF, 0xFF];
    [&plain[..132], &meta, data_set, &tag, pixels].concat()
}

#[test]
fn what_cannot_be_decoded_is_refused() {
    let code_of_file = |bytes: &[u8]| {
        let folder = scratch();
        let path = folder.path().join("slice.dcm");
        std::fs::write(&path, bytes).expect("writable");
        dicom_error(read(&path, &ReadOptions::default())).code()
    };
    assert_eq!(code_of_file(&recoded("1.2.840.10008.1.2.4.100", &[])), "E-DICOM-SYNTAX");
    let item =
        |bytes: &[u8]| [&[0xFE, 0xFF, 0x00, 0xE0][..], &(bytes.len() as u32).to_le_bytes(), bytes].concat();
    let end = [0xFE, 0xFF, 0xDD, 0xE0, 0, 0, 0, 0];
    let junk = [item(&[]), item(b"no image in here"), end.to_vec()].concat();
    let two: Vec<Vec<u8>> = [0.0, 1.0].iter().map(|_| recoded("1.2.840.10008.1.2.4.80", &junk)).collect();
    let folder = scratch();
    for (index, bytes) in two.iter().enumerate() {
        let height = format!("-20\\-30\\{index}");
        let moved = String::from_utf8_lossy(b"-20\\-30\\0").into_owned();
        let at = bytes.windows(moved.len()).position(|window| window == moved.as_bytes()).expect("a place");
        let mut bytes = bytes.clone();
        bytes[at..at + height.len()].copy_from_slice(height.as_bytes());
        std::fs::write(folder.path().join(index.to_string()), bytes).expect("writable");
    }
    assert_eq!(dicom_error(read(folder.path(), &ReadOptions::default())).code(), "E-DICOM-PIXELS");
    assert_eq!(code_of_file(&Slice::at(0.0).bytes()[..400]), "E-DICOM-DAMAGED");
}

/// Mutants of a series, one file of it changed each time: no panic, and nothing beyond the limit.
#[test]
fn mutants_never_panic() {
    let folder = scratch();
    let slices = stack(&[0.0, 1.0, 2.0, 3.0]);
    let paths = write(folder.path(), &slices, |index| index.to_string());
    let options = ReadOptions { max_bytes: 1 << 20, ..ReadOptions::default() };
    let mut stream = Stream::new(23, Purpose::Test, 0, 0);
    let (mut n_read, mut n_refused) = (0, 0);
    for round in 0..1000_usize {
        let path = &paths[round % 4];
        let original = slices[round % 4].bytes();
        let mut bytes = original.clone();
        for _ in 0..1 + stream.below(3) {
            let at = 128 + stream.below(bytes.len() as u32 - 128) as usize;
            match stream.below(8) {
                0 => bytes.truncate(at.max(200)),
                1 => drop(bytes.drain(at..(at + 2).min(bytes.len()))),
                2 => bytes[at] = 0xFF,
                3 => bytes[at] ^= 1 << stream.below(8),
                4 => bytes[at] = b'9',
                _ => bytes[at] = stream.next_u32() as u8,
            }
        }
        std::fs::write(path, &bytes).expect("writable");
        let options = ReadOptions { resample: round % 2 == 0, ..options };
        match read(folder.path(), &options) {
            Ok(loaded) => {
                n_read += 1;
                assert!(loaded.volume.grid().n_voxels() <= 1 << 19);
            }
            Err(Error::Read { problem, .. }) => {
                n_refused += 1;
                assert!(!matches!(problem, ReadError::Io(_)), "{problem} is no fault of the disk");
            }
            Err(error) => panic!("{error}"),
        }
        std::fs::write(path, original).expect("writable");
    }
    assert!(n_read > 100 && n_refused > 100, "{n_read} read, {n_refused} refused: too one-sided");
}

/// Deflated data sets, some with much before the pixels: the same scan, whatever is in the way; cut short, an error.
#[test]
fn deflated_slices_are_the_same_scan() {
    let slices = stack(&[0.0, 2.0, 4.0, 6.0]);
    let plain = loaded(&slices);
    let folder = scratch();
    // A comment of a megabyte, which deflates to very little.
    let comment = vec![b' '; 1 << 20];
    let wide = |slice: &Slice| slice.clone().with(0x0028_4000, "UN", &comment).deflated();
    let files: Vec<Vec<u8>> =
        slices.iter().enumerate().map(|(i, s)| if i < 2 { s.deflated() } else { wide(s) }).collect();
    assert!(files.iter().all(|file| file.len() < 64 << 10));
    let write = |files: &[Vec<u8>]| {
        for (index, file) in files.iter().enumerate() {
            std::fs::write(folder.path().join(format!("{index}.dcm")), file).expect("writable");
        }
    };
    write(&files);
    let inflated = read(folder.path(), &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(inflated.volume, plain.volume);
    // Less than the comment may be held: the slice is named, and nothing is guessed.
    let little = ReadOptions { max_bytes: 512 << 10, ..ReadOptions::default() };
    assert_eq!(dicom_error(read(folder.path(), &little)).class().exit_code(), 3);
    let cut: Vec<Vec<u8>> = files.iter().map(|file| file[..file.len() - 30].to_vec()).collect();
    write(&cut);
    assert_eq!(dicom_error(read(folder.path(), &ReadOptions::default())).class().exit_code(), 3);
}

/// A file is read by the piece; where an element ends with the first piece, the pixels are in the next.
#[test]
fn an_element_may_end_where_a_piece_does() {
    const PIECE: usize = 64 << 10;
    let padded = |z: f64, n_bytes: usize| Slice::at(z).with(0x0009_1010, "OB", &vec![7; n_bytes]);
    let bytes = padded(0.0, 2).bytes();
    let head = bytes.windows(6).position(|six| six == b"\x09\x00\x10\x10OB").expect("the element");
    let slices = [0.0, 1.0].map(|z| padded(z, PIECE - head - 12));
    assert_eq!(&slices[0].bytes()[PIECE..PIECE + 4], &[0x10, 0x00, 0x10, 0x00], "an element begins here");
    assert_eq!(loaded(&slices).volume, loaded(&stack(&[0.0, 1.0])).volume);
}

/// The part of a series that is asked for is held beside the whole: both count.
#[test]
fn a_part_counts_beside_the_whole() {
    let folder = scratch();
    let heights: Vec<f64> = (0..64).map(f64::from).collect();
    write(folder.path(), &stack(&heights), |index| format!("{index}.dcm"));
    let corners = [DVec3::splat(-1e3), DVec3::splat(1e3)];
    // 64 slices of 30 pixels of 2 bytes, and what decoding one takes, are within 6000 bytes; the same in 4 bytes is not.
    let options = ReadOptions { max_bytes: 6000, ..ReadOptions::default() };
    assert!(read(folder.path(), &options).is_ok());
    let error = read_box(folder.path(), &options, (corners, 1)).map(drop).expect_err("too large");
    assert_eq!(error.code(), "E-VOLUME-TOO-LARGE");
}
