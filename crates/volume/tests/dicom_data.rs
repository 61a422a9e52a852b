//! Scans of other people in DICOM against the same scans in other formats and as another program reads them.
#![allow(clippy::expect_used, clippy::print_stdout, reason = "this is how a test speaks")]

mod common;

use common::{data, load};
use espalier_model::Volume;
use espalier_volume::{Loaded, ReadOptions, read};
use glam::DVec3;

fn resampled() -> ReadOptions {
    ReadOptions { resample: true, ..ReadOptions::default() }
}

/// The same scan as DICOM and as NRRD: every value at the same place in the body.
#[test]
fn series_equals_nrrd() {
    let Some(data) = data() else { return };
    let series = load(&data.join("volumes/cip_ct64_dicom_series"), &ReadOptions::default());
    let nrrd = load(&data.join("volumes/cip_ct64.nrrd"), &ReadOptions::default());
    let (a, b) = (series.volume, nrrd.volume);
    assert_eq!((a.grid().shape(), a.grid().orientation()), (b.grid().shape(), b.grid().orientation()));
    assert_eq!(a.map_values(|value| value), b.map_values(|value| value));
    // DICOM writes positions with three decimals.
    for corner in [[0, 0, 0], [63, 0, 0], [0, 63, 0], [0, 0, 78], [63, 63, 78]] {
        let voxel = DVec3::from_array(corner.map(f64::from));
        let [p, q] = [&a, &b].map(|volume| volume.grid().world_from_voxel().transform_point3(voxel));
        assert!((p - q).length() < 2e-3, "{corner:?}: {p} and {q}");
    }
    assert!(series.report.warnings.is_empty());
}

/// JPEG 2000, 20 slices whose names run against their positions: sums as SimpleITK 2.5 reads them.
#[test]
fn series_equals_simpleitk() {
    let Some(data) = data() else { return };
    let Loaded { volume, report } =
        load(&data.join("volumes/totalseg_ct_dicom_series"), &ReadOptions::default());
    assert!(report.warnings.is_empty());
    let grid = volume.grid();
    assert_eq!((grid.shape(), grid.orientation().as_str()), ([512, 512, 20], "LPS"));
    let origin = grid.world_from_voxel().translation;
    assert!((origin - DVec3::new(249.511_718_75, 437.511_718_75, -804.5)).length() < 1e-4, "{origin}");
    assert!((grid.spacing_mm() - DVec3::new(0.976_562_5, 0.976_562_5, 2.0)).length() < 1e-6);
    let values = volume.map_values(|value| value as i64);
    let weighted = values.iter().enumerate().map(|(i, value)| value * (i as i64 % 1009 + 1)).sum::<i64>();
    assert_eq!((values.iter().sum::<i64>(), weighted), (-3_272_217_339, -1_652_600_234_823));
    assert_eq!(values[(3 * 512 + 300) * 512 + 250], 115);
}

/// Tilted and uneven: at the place of each slice's pixels, as its header states it, the resampled volume has their
/// values, up to interpolation.
#[test]
fn tilted_series_lands_in_place() {
    let Some(data) = data() else { return };
    let folder = data.join("bad/dicom_gantry_tilt_uneven");
    let refused = read(&folder, &ReadOptions::default()).expect_err("tilted").to_string();
    assert!(refused.contains("tilted by 18.5 degrees"), "{refused}");
    assert!(refused.contains("from 1.081 to 6.999 mm"), "{refused}");

    let volume = load(&folder, &resampled()).volume;
    // First pixel and height of three slices as `dcmdump` shows them, LPS; the pixels lie 0.4882812 mm apart.
    let down = DVec3::new(0.0, 0.948_323_7, -0.317_304_7) * 0.488_281_2;
    for (file, z) in [("01.dcm", 5.836_058_6), ("09.dcm", 39.596_058_6), ("28.dcm", 157.776_058_6)] {
        let bytes = std::fs::read(folder.join(file)).expect("readable");
        let pixels = &bytes[bytes.len() - 2 * 512 * 512..];
        let value = |x: usize, y: usize| {
            let at = 2 * (y * 512 + x);
            f64::from(i16::from_le_bytes([pixels[at], pixels[at + 1]]))
        };
        let first = DVec3::new(-125.0, -123.540_456_9, z);
        let mean_difference = |shift: DVec3| {
            let points = (100..400).step_by(3).flat_map(|y| (100..400).step_by(3).map(move |x| (x, y)));
            let difference = |(x, y): (usize, usize)| {
                let lps = first + DVec3::X * (0.488_281_2 * x as f64) + down * y as f64 + shift;
                (value_near(&volume, DVec3::new(-lps.x, -lps.y, lps.z)) - value(x, y)).abs()
            };
            points.map(difference).sum::<f64>() / 10_000.0
        };
        let (in_place, off) = (mean_difference(DVec3::ZERO), mean_difference(DVec3::X * 0.488_281_2));
        println!("{file}: mean difference {in_place:.2} HU, {off:.2} HU one pixel off");
        assert!(in_place < MAX_MEAN_DIFFERENCE_HU && off > 2.0 * in_place, "{file}: {in_place}, {off}");
    }
}

/// Of interpolation within and between slices of a head: 3.2 HU seen.
const MAX_MEAN_DIFFERENCE_HU: f64 = 5.0;

/// The trilinear value at a point.
fn value_near(volume: &Volume, ras: DVec3) -> f64 {
    let voxel = volume.grid().voxel_from_world().transform_point3(ras);
    let (base, mut sum) = (voxel.floor(), 0.0);
    for corner in 0..8_u32 {
        let step = DVec3::new(f64::from(corner & 1), f64::from(corner >> 1 & 1), f64::from(corner >> 2));
        let share = DVec3::ONE - (voxel - base - step).abs();
        let far = DVec3::from_array(volume.grid().shape().map(|extent| extent as f64 - 1.0));
        let at = (base + step).clamp(DVec3::ZERO, far).to_array().map(|v| v as usize);
        sum += share.x * share.y * share.z * volume.value(volume.grid().index(at));
    }
    sum
}
