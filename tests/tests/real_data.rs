//! The whole way on other people's scans, masks and neurons: certified, and plausible.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

use std::path::Path;

use espalier_pipeline::Override;
use espalier_tests::{real_data, results, run, set, small_swarm};

/// What a run must come to.
struct Expected {
    tips: std::ops::RangeInclusive<usize>,
    length_mm: std::ops::RangeInclusive<f64>,
}

#[track_caller]
fn check(input: &str, overrides: &[Override], expected: &Expected) {
    let Some(data) = real_data() else { return };
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut all = small_swarm();
    all.extend(overrides.iter().cloned());
    run(&data.join(input), folder.path(), &all, 2).expect("a run");
    let (tree, embedding) = results(folder.path());
    assert!(embedding.certificate.holds(), "{} crossings", embedding.certificate.crossings);
    assert!(expected.tips.contains(&tree.n_tips()), "{} tips", tree.n_tips());
    assert!(expected.length_mm.contains(&tree.length_mm()), "{} mm", tree.length_mm());
    let radial = embedding.methods.iter().find(|row| row.method == "radial").expect("radial ran");
    assert!(embedding.energy.total() <= radial.energy.total(), "worse than radial");
    assert!(Path::new(&folder.path().join("planar.png")).exists());
}

#[test]
fn pulmonary_ct() {
    let region_growing = [
        set("volume.method", "region-grow"),
        set("volume.upper", -865),
        set("volume.seed_voxel", "[58, 80, 85]"),
        set("tree.root", "superior"),
    ];
    check(
        "volumes/totalseg_pulmonary_ct.nii.gz",
        &region_growing,
        &Expected { tips: 15..=60, length_mm: 400.0..=1500.0 },
    );
}

#[test]
fn bronchi() {
    check(
        "volumes/exact09_case18_bronchi.nii.gz",
        &[],
        &Expected { tips: 20..=60, length_mm: 700.0..=2500.0 },
    );
}

#[test]
fn thick_slice_hepatic_vein() {
    check(
        "volumes/medmpd_liver3_hepatic_vein.nii.gz",
        &[],
        &Expected { tips: 10..=120, length_mm: 300.0..=4000.0 },
    );
}

#[test]
fn aorta() {
    check(
        "volumes/vmtk_aorta_levelset_mask.nii.gz",
        &[],
        &Expected { tips: 2..=3, length_mm: 100.0..=500.0 },
    );
}

#[test]
fn olfactory_fibre_in_pixels_and_slices() {
    let scale = [set("input.scale", "[0.33, 0.33, 1.0]")];
    check("neurons/diadem_OP_5.swc", &scale, &Expected { tips: 5..=60, length_mm: 0.1..=3.0 });
}

#[test]
fn hemibrain_neuron() {
    let voxels = [
        set("input.unit", "nm"),
        set("input.scale", "[8.0, 8.0, 8.0]"),
        set("embed.pso.particles", 8),
        set("embed.pso.iterations", 1),
    ];
    check("neurons/hemibrain_722817260.swc", &voxels, &Expected { tips: 300..=3000, length_mm: 0.5..=20.0 });
}
