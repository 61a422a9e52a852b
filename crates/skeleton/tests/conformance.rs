//! `lee94` in stored order equals scikit-image's `skeletonize(method = "lee")`, voxel for voxel.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "tests say what they found, and fail aloud"
)]

mod common;

use espalier_model::Mask;
use espalier_skeleton::{Orientation, Params, Thinning, skeletonize};
use sha2::{Digest as _, Sha256};

/// Name, skeleton voxels, first 16 hex digits of the sha256 of the skeleton as bytes 0 and 1, x fastest.
const CASES: [(&str, usize, &str); 7] = [
    ("totalseg_pulmonary_airway", 760, "f42e7ca2a8d1131d"),
    ("exact09_case18_bronchi", 1246, "a46ea03478d5d7ee"),
    ("medmpd_lungs1_bronchi", 1415, "51af787c5ee3f7f1"),
    ("airquant_airway", 733, "1f948e0bbea82086"),
    ("medmpd_liver3_hepatic_vein", 1157, "160876b27bf752fc"),
    ("vmtk_aorta_levelset_mask", 120, "2080d21a547646cf"),
    ("medmpd_brain2_vessels", 13327, "66076f7fc150827a"),
];

#[test]
fn lee94_is_the_reference_bit_for_bit() {
    let Some(data) = common::data_folder() else { return };
    let params = Params { thinning: Thinning::Lee94, orientation: Orientation::Stored };
    for (name, n_voxels, digest) in CASES {
        let mask = common::read_mask(&data.join(format!("volumes/{name}.nii.gz")));
        let reference = common::read_mask(&data.join(format!("reference/lee94/{name}.nii.gz")));
        let skeleton = skeletonize(&mask, &params).expect("not empty").skeleton;

        let mut bytes = vec![0_u8; mask.grid().n_voxels()];
        for &voxel in skeleton.voxels() {
            bytes[mask.grid().index(voxel.map(|c| c as usize))] = 1;
        }
        let n_different =
            bytes.iter().zip(reference.to_voxels()).filter(|&(&ours, theirs)| (ours == 1) != theirs).count();
        assert_eq!((skeleton.voxels().len(), n_different), (n_voxels, 0), "{name}: voxels, different");
        let hex: String = Sha256::digest(&bytes).iter().take(8).map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(hex, digest, "{name}");
    }
}

/// Small volumes and what scikit-image 0.26 leaves of them; the format stands in `scripts/lee94-fixture`.
const FIXTURE: &str = include_str!("../../../fixtures/lee94.tsv");

/// Voxels from hex digits, four to a digit, the first voxel the highest bit.
fn unpacked(hex: &str, n_voxels: usize) -> Vec<bool> {
    let bits = hex.chars().flat_map(|digit| {
        let four = digit.to_digit(16).expect("a hex digit");
        (0..4).rev().map(move |bit| four >> bit & 1 == 1)
    });
    let mut voxels: Vec<bool> = bits.collect();
    assert!(voxels.len() >= n_voxels && voxels.split_off(n_voxels).iter().all(|&filler| !filler));
    voxels
}

#[test]
fn lee94_is_scikit_image_on_small_volumes() {
    let params = Params { thinning: Thinning::Lee94, orientation: Orientation::Stored };
    let (mut n_cases, mut n_voxels) = (0, 0);
    for line in FIXTURE.lines().skip(1) {
        let [name, nx, ny, nz, volume, skeleton] = line.split('\t').collect::<Vec<_>>()[..] else {
            panic!("not six fields: {line}")
        };
        let shape = [nx, ny, nz].map(|extent| extent.parse().expect("an extent"));
        let volume = unpacked(volume, shape.iter().product());
        let mask = Mask::from_voxels(common::grid(shape), &volume);
        let expected = unpacked(skeleton, volume.len());
        assert!(common::skeleton_mask(&mask, &params).to_voxels() == expected, "{name} {shape:?}");
        n_cases += 1;
        n_voxels += expected.iter().filter(|&&voxel| voxel).count();
    }
    assert!(n_cases == 64 && n_voxels > 1000, "{n_cases} cases, {n_voxels} skeleton voxels");
}
