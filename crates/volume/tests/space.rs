//! Where a volume lies: the affine ladder by headers made here, round trips through our own writer.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

use std::path::Path;

use espalier_geom::random::{Purpose, Stream};
use espalier_model::{Diagnose, Grid, Mask, Skeleton, Volume, Voxels, nifti_out};
use espalier_volume::{AssumedSpace, Loaded, ReadOptions, read};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use ndarray::Array3;

/// A header field by field, over 3x4x5 voxels of 8 bits unless said otherwise.
struct Made(Vec<u8>);

impl Made {
    fn new() -> Self {
        let mut made = Self(vec![0; 352 + 60]);
        made.i32(0, 348).i16(40, &[3, 3, 4, 5, 1, 1, 1, 1]).i16(70, &[2, 8]);
        made.f32(76, &[1.0, 1.0, 2.0, 3.0]).f32(108, &[352.0, 1.0, 0.0]);
        made.0[123] = 2;
        made.0[344..348].copy_from_slice(b"n+1\0");
        (0..60).for_each(|i| made.0[352 + i] = i as u8);
        made
    }

    fn put(&mut self, offset: usize, bytes: &[u8]) -> &mut Self {
        self.0[offset..offset + bytes.len()].copy_from_slice(bytes);
        self
    }

    fn i32(&mut self, offset: usize, value: i32) -> &mut Self {
        self.put(offset, &value.to_le_bytes())
    }

    fn i16(&mut self, offset: usize, values: &[i16]) -> &mut Self {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.put(offset, &bytes)
    }

    fn f32(&mut self, offset: usize, values: &[f32]) -> &mut Self {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.put(offset, &bytes)
    }

    fn sform(&mut self, rows: [[f32; 4]; 3]) -> &mut Self {
        self.i16(254, &[1]).f32(280, rows.as_flattened())
    }

    fn qform(&mut self, bcd: [f32; 3], origin: [f32; 3]) -> &mut Self {
        self.i16(252, &[1]).f32(256, &bcd).f32(268, &origin)
    }

    /// The same in the other byte order: every field swapped by its own width.
    fn swapped(&self) -> Vec<u8> {
        let mut bytes = self.0.clone();
        let mut swap = |from: usize, to: usize, width: usize| {
            bytes[from..to].chunks_mut(width).for_each(<[u8]>::reverse);
        };
        swap(0, 4, 4);
        swap(40, 56, 2);
        swap(70, 74, 2);
        swap(76, 120, 4);
        swap(252, 256, 2);
        swap(256, 328, 4);
        bytes
    }

    fn read(&self, options: &ReadOptions) -> Result<Loaded, espalier_volume::Error> {
        read_bytes(&self.0, options)
    }

    /// The affine's columns, or the error's code; then the warnings.
    fn outcome(&self, options: &ReadOptions) -> (Vec<f64>, String) {
        match self.read(options) {
            Ok(loaded) => {
                let columns = loaded.volume.grid().world_from_voxel().to_cols_array().to_vec();
                let codes: Vec<&str> = loaded.report.warnings.iter().map(|warning| warning.code).collect();
                (columns, codes.join(" "))
            }
            Err(error) => (Vec::new(), error.code().to_owned()),
        }
    }
}

fn read_bytes(bytes: &[u8], options: &ReadOptions) -> Result<Loaded, espalier_volume::Error> {
    let folder = tempfile::tempdir().expect("a folder for temporary files");
    let path = folder.path().join("made.NII.GZ");
    std::fs::write(&path, bytes).expect("writable");
    read(Path::new(&path), options)
}

const SFORM: [[f32; 4]; 3] = [[-1.0, 0.0, 0.0, 10.0], [0.0, -2.0, 0.0, 20.0], [0.0, 0.0, 3.0, 30.0]];
const LPS: [f64; 12] = [-1.0, 0.0, 0.0, 0.0, -2.0, 0.0, 0.0, 0.0, 3.0, 10.0, 20.0, 30.0];

#[test]
fn the_ladder() {
    let options = ReadOptions::default();
    let ok = |columns: &[f64], warnings: &str| (columns.to_vec(), warnings.to_owned());
    let error = |code: &str| (Vec::new(), code.to_owned());

    // sform alone; qform alone, by half a turn about z; both and equal.
    assert_eq!(Made::new().sform(SFORM).outcome(&options), ok(&LPS, ""));
    assert_eq!(Made::new().qform([0.0, 0.0, 1.0], [10.0, 20.0, 30.0]).outcome(&options), ok(&LPS, ""));
    let mut both = Made::new();
    both.sform(SFORM).qform([0.0, 0.0, 1.0], [10.0, 20.0, 30.0]);
    assert_eq!(both.outcome(&options), ok(&LPS, ""));
    // Both, differing by 0.02 mm, in handedness, and a qform that is no rotation: the sform, with a warning.
    assert_eq!(both.f32(268, &[10.02]).outcome(&options), ok(&LPS, "W-NIFTI-FORMS"));
    assert_eq!(both.f32(268, &[10.0]).f32(76, &[-1.0]).outcome(&options), ok(&LPS, "W-NIFTI-FORMS"));
    assert_eq!(both.f32(256, &[2.0]).outcome(&options), ok(&LPS, "W-NIFTI-QFORM"));
    let loaded = both.f32(256, &[0.0]).read(&options).expect("readable");
    let message = &loaded.report.warnings[0].message;
    assert!(message.contains("handedness") && message.contains("[0.0000 0.0000 -3.0000]"), "{message}");

    // qfac: only a negative one mirrors z; 0 and NaN do not.
    let quarter = [0.0, 0.0, std::f32::consts::FRAC_1_SQRT_2];
    for (qfac, z) in [(1.0, 3.0), (0.0, 3.0), (f32::NAN, 3.0), (-1.0, -3.0)] {
        let (columns, _) = Made::new().qform(quarter, [0.0; 3]).f32(76, &[qfac]).outcome(&options);
        let expected = [0.0, 1.0, 0.0, -2.0, 0.0, 0.0, 0.0, 0.0, z, 0.0, 0.0, 0.0];
        assert!(columns.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "qfac {qfac}: {columns:?}");
    }

    // Neither: an error, or what the caller assumes.
    assert_eq!(Made::new().outcome(&options), error("E-VOLUME-NO-SPACE"));
    let hint = Made::new().read(&options).expect_err("no space").hint();
    assert!(hint.contains("--assume-space ras"), "{hint}");
    for (space, letters) in
        [(AssumedSpace::Ras, "RAS"), (AssumedSpace::Las, "LAS"), (AssumedSpace::Lps, "LPS")]
    {
        let options = ReadOptions { assume_space: Some(space), ..options };
        let loaded = Made::new().read(&options).expect("assumed");
        assert_eq!(loaded.volume.grid().orientation(), letters);
        assert_eq!(loaded.volume.grid().spacing_mm(), DVec3::new(1.0, 2.0, 3.0));
        // What the file says counts, not what is assumed.
        assert_eq!(Made::new().sform(SFORM).outcome(&options), ok(&LPS, ""));
    }

    // Numbers that are no place.
    for bad in [f32::NAN, f32::INFINITY] {
        assert_eq!(Made::new().sform(SFORM).f32(284, &[bad]).outcome(&options), error("E-VOLUME-FORM"));
        assert_eq!(Made::new().qform([0.0, bad, 0.0], [0.0; 3]).outcome(&options), error("E-VOLUME-FORM"));
    }
    assert_eq!(Made::new().sform([SFORM[0], SFORM[0], SFORM[2]]).outcome(&options), error("E-VOLUME-FORM"));
    for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        assert_eq!(
            Made::new().qform(quarter, [0.0; 3]).f32(80, &[bad]).outcome(&options),
            error("E-VOLUME-FORM")
        );
        assert_eq!(Made::new().f32(80, &[bad]).outcome(&options), error("E-VOLUME-FORM"));
        // The sform places the volume; pixdim is only reported.
        assert_eq!(Made::new().sform(SFORM).f32(80, &[bad]).outcome(&options), ok(&LPS, "W-NIFTI-PIXDIM"));
    }
}

#[test]
fn units() {
    let spacing = |xyzt: u8, unit_mm: Option<f64>| {
        let mut made = Made::new();
        made.sform(SFORM).put(123, &[xyzt]);
        let loaded = made.read(&ReadOptions { unit_mm, ..ReadOptions::default() }).expect("readable");
        (loaded.volume.grid().spacing_mm().x as f32, loaded.report.warnings.len())
    };
    assert_eq!(spacing(2 | 8, None), (1.0, 0));
    assert_eq!(spacing(1, None), (1000.0, 0));
    assert_eq!(spacing(3, None), (0.001, 0));
    assert_eq!(spacing(0, None), (1.0, 1));
    assert_eq!(spacing(6, None), (1.0, 1));
    assert_eq!(spacing(0, Some(1e-6)), (1e-6, 0));
}

#[test]
fn both_byte_orders_and_every_type() {
    let mut made = Made::new();
    made.sform(SFORM);
    let little = made.read(&ReadOptions::default()).expect("little-endian").volume;
    let big = read_bytes(&made.swapped(), &ReadOptions::default()).expect("big-endian").volume;
    assert_eq!(little, big);

    // Datatype, bits, the bytes of -2 (or of what its type makes of it), and its value; slope 2, intercept 1.
    let cases: [(i16, i16, Vec<u8>, f64); 10] = [
        (2, 8, 254_u8.to_be_bytes().into(), 254.0),
        (256, 8, (-2_i8).to_be_bytes().into(), -2.0),
        (4, 16, (-2_i16).to_be_bytes().into(), -2.0),
        (512, 16, 65_534_u16.to_be_bytes().into(), 65_534.0),
        (8, 32, (-2_i32).to_be_bytes().into(), -2.0),
        (768, 32, 4_294_967_294_u32.to_be_bytes().into(), 4_294_967_294.0),
        (1024, 64, (-2_i64).to_be_bytes().into(), -2.0),
        (1280, 64, 2_u64.to_be_bytes().into(), 2.0),
        (16, 32, (-0.5_f32).to_be_bytes().into(), -0.5),
        (64, 64, (-0.1_f64).to_be_bytes().into(), -0.1),
    ];
    for (datatype, bits, number, value) in cases {
        let mut made = Made::new();
        made.sform(SFORM).i16(70, &[datatype, bits]).f32(112, &[2.0, 1.0]);
        let mut bytes = made.swapped();
        bytes.truncate(352);
        (0..60).for_each(|_| bytes.extend_from_slice(&number));
        let volume = read_bytes(&bytes, &ReadOptions::default()).expect("readable").volume;
        assert_eq!((volume.value(0), volume.value(59)), (2.0 * value + 1.0, 2.0 * value + 1.0), "{datatype}");
    }
}

#[test]
fn four_dimensions() {
    let mut made = Made::new();
    made.sform(SFORM).i16(40, &[4, 3, 4, 1, 5]);
    let with = |volume_index| ReadOptions { volume_index, ..ReadOptions::default() };
    let error = made.read(&with(None)).expect_err("which one?");
    assert!(error.to_string().contains("5 volumes") && error.hint().contains("--volume-index 0"), "{error}");
    let third = made.read(&with(Some(3))).expect("the third").volume;
    assert_eq!((third.value(0), third.value(11)), (36.0, 47.0));
    let error = made.read(&with(Some(5))).expect_err("there are five");
    assert_eq!((error.code(), error.class().exit_code()), ("E-VOLUME-VOLUME-INDEX", 2));
}

#[test]
fn shear_is_resampled_or_refused() {
    // z leans over x, as in a CT with a tilted gantry.
    let tilt = [[1.0, 0.0, 1.5, 5.0], [0.0, 2.0, 0.0, 0.0], [0.0, 0.0, 3.0, 0.0]];
    let mut made = Made::new();
    made.sform(tilt);
    let strict = ReadOptions { strict: true, ..ReadOptions::default() };
    assert_eq!(made.outcome(&strict).1, "E-VOLUME-SHEAR");
    let hint = made.read(&strict).expect_err("sheared").hint();
    assert!(hint.contains("without `--strict`"), "{hint}");
    let loaded = made.read(&ReadOptions::default()).expect("resampled");
    let grid = loaded.volume.grid().clone();
    let cosines = grid.world_from_voxel().matrix3;
    assert!(cosines.x_axis.dot(cosines.z_axis).abs() < 1e-6);
    // Each old voxel's value stands in the new voxel about its centre, or in a neighbour of it.
    let old = DAffine3::from_cols(DVec3::X, DVec3::Y * 2.0, DVec3::new(1.5, 0.0, 3.0), DVec3::X * 5.0);
    for value in 0..60_u32 {
        let voxel = DVec3::new(f64::from(value % 3), f64::from(value / 3 % 4), f64::from(value / 12));
        let place = grid.voxel_from_world().transform_point3(old.transform_point3(voxel)).round();
        let [x, y, z] = grid.voxel_at(place).expect("the new grid holds all of the old one");
        let found = loaded.volume.value(grid.index([x, y, z]));
        let expected = [value, value.wrapping_sub(1), value + 1].map(f64::from);
        assert!(expected.contains(&found) || found == 0.0, "{value} became {found}");
    }
    assert!((grid.spacing_mm() - DVec3::new(1.0, 2.0, 11.25_f64.sqrt())).length() < 1e-6);
}

/// A linear field in the world is reproduced by trilinear resampling wherever the old volume reaches.
#[test]
fn floats_are_resampled_linearly() {
    let (columns, field) = (
        [DVec3::new(1.0, 0.1, 0.0), DVec3::new(0.3, 1.0, 0.0), DVec3::new(0.0, 0.2, 1.5), DVec3::ZERO],
        |p: DVec3| 100.0 + 3.0 * p.x - 2.0 * p.y + 5.0 * p.z,
    );
    let affine = DAffine3::from_cols(columns[0], columns[1], columns[2], columns[3]);
    let row = |i: usize| columns.map(|column| column[i] as f32);
    let mut made = Made::new();
    made.sform([row(0), row(1), row(2)]).i16(40, &[3, 12, 12, 12]).i16(70, &[16, 32]);
    made.0.truncate(352);
    for index in 0..12 * 12 * 12_usize {
        let voxel = DVec3::new((index % 12) as f64, (index / 12 % 12) as f64, (index / 144) as f64);
        made.0.extend_from_slice(&(field(affine.transform_point3(voxel)) as f32).to_le_bytes());
    }
    let volume = made.read(&ReadOptions::default()).expect("resampled").volume;
    let (grid, old_from_world) = (volume.grid(), affine.inverse());
    let mut n_checked = 0;
    for index in 0..grid.n_voxels() {
        let [x, y, z] = grid.voxel(index).map(|v| v as f64);
        let world = grid.world_from_voxel().transform_point3(DVec3::new(x, y, z));
        let old = old_from_world.transform_point3(world);
        if old.min_element() >= 0.0 && old.max_element() <= 11.0 {
            assert!((volume.value(index) - field(world)).abs() < 1e-3, "at {world}");
            n_checked += 1;
        }
    }
    assert!(n_checked > 1000, "{n_checked}");
}

/// What we write we read back: same grid, same numbers, no warning; and writing it again gives the same bytes.
#[test]
fn round_trip_of_random_grids() {
    let mut stream = Stream::new(3, Purpose::Test, 0, 0);
    for case in 0..60_u32 {
        let mut turn = || stream.normal();
        let rotation = DMat3::from_quat(DQuat::from_xyzw(turn(), turn(), turn(), turn()).normalize());
        let mirror = if case % 2 == 0 { 1.0 } else { -1.0 };
        let spacing = DVec3::new(stream.uniform(0.3, 3.0), stream.uniform(0.3, 3.0), mirror * 0.7);
        let origin = DVec3::new(stream.uniform(-300.0, 300.0), 12.5, stream.uniform(-1e3, 1e3));
        let affine = DAffine3::from_mat3_translation(rotation * DMat3::from_diagonal(spacing), origin);
        let grid = Grid::new([300, 5, 2], affine).expect("legal");
        let values: Vec<i16> = (0..3000).map(|_| stream.next_u32() as i16).collect();
        let array = Array3::from_shape_vec((2, 5, 300), values).expect("as many as voxels");
        let volume = Volume::new(grid.clone(), Voxels::I16(array), 1.0, 0.0);
        let bytes = nifti_out::volume(&volume).expect("fits");
        let loaded = read_bytes(&bytes, &ReadOptions::default()).expect("our own file");
        assert!(loaded.report.warnings.is_empty(), "case {case}: {:?}", loaded.report.warnings);
        assert_eq!(loaded.volume.grid(), &nifti_out::stored_grid(&grid).expect("legal"));
        assert_eq!(loaded.volume.voxels(), volume.voxels());
        assert_eq!(nifti_out::volume(&loaded.volume).expect("fits"), bytes, "case {case}");
        // The qform alone places the volume too, as far as its single precision goes.
        let mut plain = Vec::new();
        std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(&bytes[..]), &mut plain).expect("gzip");
        plain[254..256].fill(0);
        let by_qform = read_bytes(&plain, &ReadOptions::default()).expect("qform").volume;
        let far = DVec3::new(299.0, 4.0, 1.0);
        let at = |volume: &Volume| volume.grid().world_from_voxel().transform_point3(far);
        assert!(at(&by_qform).distance(at(&volume)) < 0.5, "case {case}");
    }
}

#[test]
fn every_kind_of_output_comes_back() {
    let grid = Grid::axis_aligned([4, 3, 2], DVec3::new(0.5, 1.0, 2.0), DVec3::ZERO).expect("legal");
    let read_values = |bytes: Vec<u8>| {
        let volume = read_bytes(&bytes, &ReadOptions::default()).expect("our own file").volume;
        assert_eq!(volume.grid(), &grid);
        volume.map_values(|value| value)
    };
    let is_set = |i: usize| i % 5 == 1;
    let mask = Mask::from_fn(grid.clone(), |voxel| is_set(grid.index(voxel)));
    let expected: Vec<f64> = (0..24).map(|i| f64::from(u8::from(is_set(i)))).collect();
    assert_eq!(read_values(nifti_out::mask(&mask).expect("fits")), expected);
    let voxels = (0..24).filter(|&i| is_set(i)).map(|i| grid.voxel(i).map(|v| v as u32)).collect();
    let skeleton = Skeleton::new(grid.clone(), voxels);
    assert_eq!(read_values(nifti_out::skeleton(&skeleton).expect("fits")), expected);
    let value = |i: usize| i as f32 / 7.0;
    let expected: Vec<f64> = (0..24).map(|i| if is_set(i) { f64::from(value(i)) } else { 0.0 }).collect();
    let of_mask = nifti_out::mask_scalars(&mask, |voxel| value(grid.index(voxel))).expect("fits");
    assert_eq!(read_values(of_mask), expected);
    let floats: Vec<f32> = (0..24).filter(|&i| is_set(i)).map(value).collect();
    assert_eq!(read_values(nifti_out::skeleton_scalars(&skeleton, &floats).expect("fits")), expected);
    let too_few = nifti_out::skeleton_scalars(&skeleton, &floats[1..]).expect_err("too few");
    assert_eq!(too_few.code(), "E-NIFTI-OUT-LENGTH");
    let labels: Vec<u32> = (0..24).map(|i| i * 100_000_000).collect();
    let expected: Vec<f64> = labels.iter().map(|&v| f64::from(v)).collect();
    let [nx, ny, nz] = grid.shape();
    let array = ndarray::Array3::from_shape_vec((nz, ny, nx), labels).expect("the grid's shape");
    let volume = Volume::new(grid.clone(), Voxels::U32(array), 1.0, 0.0);
    assert_eq!(read_values(nifti_out::volume(&volume).expect("fits")), expected);

    let long = Grid::axis_aligned([32_768, 1, 1], DVec3::ONE, DVec3::ZERO).expect("legal");
    let error = nifti_out::mask(&Mask::empty(long)).expect_err("too long");
    assert_eq!((error.code(), error.class().exit_code()), ("E-NIFTI-OUT-EXTENT", 5));
}

/// The gzip header has no time, no name and no system.
#[test]
fn bytes_are_the_same_everywhere() {
    let grid = Grid::axis_aligned([4, 3, 2], DVec3::ONE, DVec3::ZERO).expect("legal");
    let bytes = nifti_out::mask(&Mask::empty(grid)).expect("fits");
    assert_eq!(bytes[..10], [0x1F, 0x8B, 8, 0, 0, 0, 0, 0, 0, 255]);
}
