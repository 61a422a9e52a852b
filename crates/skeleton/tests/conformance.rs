//! `lee94` in stored order equals scikit-image's `skeletonize(method = "lee")`, voxel for voxel.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "tests say what they found, and fail aloud"
)]

mod common;

use espalier_skeleton::{Params, Thinning, skeletonize};
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
    let params = Params { thinning: Thinning::Lee94 };
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

#[test]
fn lee94_is_scikit_image_on_400_small_volumes() {
    let params = Params { thinning: Thinning::Lee94 };
    let (mut n_cases, mut n_voxels) = (0, 0);
    for (name, mask, expected) in common::fixture() {
        n_cases += 1;
        n_voxels += expected.n_foreground();
        if mask.n_foreground() > 0 {
            assert!(common::skeleton_mask(&mask, &params) == expected, "{name} {:?}", mask.grid().shape());
        }
    }
    assert!(n_cases == 400 && n_voxels > 10_000, "{n_cases} cases, {n_voxels} skeleton voxels");
}
