//! The volumes of the real data: what they are, and the airway that region growing must find.
#![allow(clippy::disallowed_methods, reason = "tests find their data through the environment")]

use std::path::PathBuf;

use espalier_model::Mask;
use espalier_volume::{Error, Kind, Method, Params, ReadOptions, inspect_kind, read, segment};

fn data() -> Option<PathBuf> {
    let folder = std::env::var_os("ESPALIER_DATA").map(PathBuf::from);
    if folder.is_none() {
        println!("skipped: ESPALIER_DATA not set");
    }
    folder
}

fn load(name: &str) -> Option<espalier_volume::Loaded> {
    let path = data()?.join("volumes").join(name);
    Some(read(&path, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}")))
}

fn airway_params(upper: f64) -> Params {
    Params {
        method: Method::RegionGrow,
        upper: Some(upper),
        seed_voxel: Some([58, 80, 85]),
        fill_cavities: false,
        ..Params::default()
    }
}

#[test]
fn airway_grows_to_the_reference() {
    let Some(ct) = load("totalseg_pulmonary_ct.nii.gz") else { return };
    assert!(matches!(inspect_kind(&ct.volume), Kind::Ct { .. }));
    assert_eq!(ct.volume.grid().orientation(), "LPS");
    let reference = load("totalseg_pulmonary_airway.nii.gz").expect("data is set");
    let reference: Mask = segment(&reference.volume, &Params { fill_cavities: false, ..Params::default() })
        .expect("a mask")
        .mask;

    let grown = segment(&ct.volume, &airway_params(-865.0)).expect("an airway");
    assert_eq!(grown.mask.n_foreground(), 8208);
    assert_eq!(grown.mask.as_slice(), reference.as_slice(), "voxel by voxel");
    assert_eq!(grown.report.get("components"), Some(1.0));

    // The four cavities of the reference, and nothing else, are filled.
    let filled = segment(&ct.volume, &Params { fill_cavities: true, ..airway_params(-865.0) }).expect("an airway");
    assert_eq!(filled.report.get("cavities_filled"), Some(4.0));
    let n_added = filled.mask.n_foreground() - 8208;
    assert_eq!(filled.report.get("cavities_filled_voxels"), Some(n_added as f64));

    // Five HU more and it is the lung.
    let leaked = segment(&ct.volume, &airway_params(-860.0)).expect("a region");
    assert!(leaked.mask.n_foreground() > 10 * 8208, "{}", leaked.mask.n_foreground());
    println!("leaked {} voxels, filled {n_added}", leaked.mask.n_foreground());

    // The seed in mm is the same voxel; a seed outside the band is told where to go.
    let seed = ct.volume.grid().world_from_voxel().transform_point3(glam::DVec3::new(58.0, 80.0, 85.0));
    let by_mm = Params { seed_voxel: None, seed_mm: Some(seed.to_array()), ..airway_params(-865.0) };
    assert_eq!(segment(&ct.volume, &by_mm).expect("an airway").mask, grown.mask);
    let off = Params { seed_voxel: Some([0, 0, 0]), ..airway_params(-865.0) };
    assert!(matches!(segment(&ct.volume, &off), Err(Error::SeedOutOfBand { .. })));
}

#[test]
fn kinds_and_counts() {
    let Some(folder) = data() else { return };
    // Counted with nibabel and scipy's `label` (26 neighbours).
    let cases: [(&str, &str, usize, f64); 4] = [
        ("totalseg_pulmonary_airway.nii.gz", "LPS", 8208, 1.0),
        ("medmpd_liver3_hepatic_vein.nii.gz", "LPS", 0, 0.0),
        ("airquant_airway.nii.gz", "LPS", 0, 0.0),
        ("vmtk_aorta_levelset_mask.nii.gz", "RAS", 0, 0.0),
    ];
    for (name, orientation, n_voxels, n_components) in cases {
        let loaded = load(name).expect("data is set");
        assert!(matches!(inspect_kind(&loaded.volume), Kind::Mask { .. }), "{name}");
        assert_eq!(loaded.volume.grid().orientation(), orientation, "{name}");
        let segmented = segment(&loaded.volume, &Params::default()).expect("a mask");
        assert_eq!(segmented.report.get("selected_voxels"), Some(n_voxels as f64), "{name}");
        assert_eq!(segmented.report.get("components"), Some(n_components), "{name}");
    }
    for name in ["ct_avm_head_cta.nii.gz", "totalseg_pulmonary_ct.nii.gz"] {
        let loaded = read(&folder.join("volumes").join(name), &ReadOptions::default()).expect("readable");
        let error = segment(&loaded.volume, &Params::default()).expect_err("a CT needs a method");
        assert!(matches!(error, Error::MethodNeeded { .. }), "{name}: {error}");
    }
    let labels = load("totalseg_example_labels.nii.gz").expect("data is set");
    assert!(matches!(inspect_kind(&labels.volume), Kind::Labels { .. }));
}
