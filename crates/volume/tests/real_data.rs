//! The volumes of the real data: what they are, and the airway that region growing must find.
#![allow(clippy::expect_used, clippy::panic, clippy::print_stdout, reason = "this is how a test speaks")]

mod common;

use common::data;
use espalier_model::{Diagnose, LedgerKind, Mask};
use espalier_volume::{
    Components, Error, Kind, Labels, Method, Params, Preset, ReadOptions, Segmented, inspect_kind,
    open_pieces, read, read_mask, segment,
};

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
        close_tunnels: false,
        ..Params::default()
    }
}

#[test]
fn airway_grows_to_the_reference() {
    let Some(ct) = load("totalseg_pulmonary_ct.nii.gz") else { return };
    assert!(matches!(inspect_kind(&ct.volume), Kind::Ct { .. }));
    assert_eq!(ct.volume.grid().orientation(), "LPS");
    let reference = load("totalseg_pulmonary_airway.nii.gz").expect("data is set");
    let reference: Mask = segment(
        &reference.volume,
        &Params { fill_cavities: false, close_tunnels: false, ..Params::default() },
    )
    .expect("a mask")
    .mask;

    let grown = segment(&ct.volume, &airway_params(-865.0)).expect("an airway");
    assert_eq!(grown.mask.n_foreground(), 8208);
    assert!(grown.mask.bits() == reference.bits(), "voxel by voxel");
    assert_eq!(grown.report.get("components"), Some(1.0));

    // The four cavities of the reference, and nothing else, are filled.
    let filled =
        segment(&ct.volume, &Params { fill_cavities: true, ..airway_params(-865.0) }).expect("an airway");
    assert_eq!(filled.report.get("cavities_filled"), Some(4.0));
    let n_added = filled.mask.n_foreground() - 8208;
    assert_eq!(filled.report.get("cavities_filled_voxels"), Some(n_added as f64));

    // Five HU more and it is the lung.
    let leaked = segment(&ct.volume, &airway_params(-860.0)).expect("a region");
    assert_eq!(leaked.mask.n_foreground(), 24_911);

    // The seed in mm is the same voxel; a seed outside the band is told where to go.
    let seed = ct.volume.grid().world_from_voxel().transform_point3(glam::DVec3::new(58.0, 80.0, 85.0));
    let by_mm = Params { seed_voxel: None, seed_mm: Some(seed.to_array()), ..airway_params(-865.0) };
    assert_eq!(segment(&ct.volume, &by_mm).expect("an airway").mask, grown.mask);
    let off = Params { seed_voxel: Some([0, 0, 0]), ..airway_params(-865.0) };
    assert!(matches!(segment(&ct.volume, &off), Err(Error::SeedOutOfBand { .. })));
}

/// No number given: the trachea is found, the region stops before the wall gives way.
#[test]
fn the_airway_grows_by_itself() {
    let Some(ct) = load("totalseg_pulmonary_ct.nii.gz") else { return };
    let params = Params { preset: Some(Preset::Airway), ..Params::default() };
    let grown = segment(&ct.volume, &params).expect("an airway");
    let count = |key| grown.report.get(key).unwrap_or(f64::NAN);
    assert!((25.0..30.0).contains(&count("foreground_ml")), "{}", count("foreground_ml"));
    assert_eq!((count("stable_threshold"), count("leaking_threshold")), (-863.0, -862.0));
    assert!(count("leaking_ml") > 2.0 * count("stable_ml"));
    // The last few HU have the beginning of the leak; over edges and corners bronchi go on.
    assert!((-880.0..-863.0).contains(&count("band_upper")), "{}", count("band_upper"));
    assert!((-960.0..-900.0).contains(&count("edges_threshold")) && count("edges_voxels") >= 30.0);
    // The trachea is in the top slices of this crop only; the main bronchus comes second.
    assert!(grown.seeds[0].voxel[2] > 95 && grown.seeds.len() > 1, "{:?}", grown.seeds);
    // At the leak's own threshold the region is what flooding it plainly gives.
    let growth = grown.growth.expect("it grew");
    for level in growth.levels.iter().filter(|level| level.threshold % 16.0 == 0.0) {
        let fixed = Params {
            method: Method::RegionGrow,
            upper: Some(level.threshold),
            seed_voxel: Some(grown.seeds[0].voxel.map(|v| v as i64)),
            ..Params::default()
        };
        let plain = segment(&ct.volume, &fixed).expect("a region");
        assert_eq!(plain.report.get("selected_voxels"), Some(level.n_voxels as f64));
    }
    let leaky = segment(&ct.volume, &airway_params(-850.0)).expect("a region");
    assert!(leaky.report.warnings.iter().any(|warning| warning.code == "W-VOLUME-LEAK"));

    // A head has no trachea: it says so, and what to do.
    let head = load("ct_avm_head_cta.nii.gz").expect("data is set");
    let error = segment(&head.volume, &params).expect_err("no trachea");
    assert_eq!((error.code(), error.class().exit_code()), ("E-VOLUME-NO-TRACHEA", 3));
    assert!(error.hint().contains("volume.seed"), "{}", error.hint());
}

/// Tunnels before and after closing, and the places that were changed.
const TUNNELS: [(&str, (usize, usize)); 5] = [
    ("airquant_airway", (0, 0)),
    ("exact09_case18_bronchi", (11, 5)),
    ("medmpd_liver3_hepatic_vein", (8, 3)),
    ("medmpd_lungs1_bronchi", (4, 0)),
    ("totalseg_pulmonary_airway", (6, 4)),
];

#[test]
fn tunnels_close_in_few_places() {
    if data().is_none() {
        return;
    }
    for (name, (before, most_after)) in TUNNELS {
        let loaded = load(&format!("{name}.nii.gz")).expect("data is set");
        let segmented = segment(&loaded.volume, &Params::default()).expect("a mask");
        let count = |key| segmented.report.get(key).unwrap_or(0.0) as usize;
        assert_eq!(count("tunnels"), before, "{name}");
        assert!(count("tunnels_left") <= most_after, "{name}: {} left", count("tunnels_left"));
        let n_changed = count("tunnel_repairs_filled_voxels") + count("tunnel_repairs_cleared_voxels");
        assert!(n_changed <= 12 * before, "{name}: {n_changed} voxels");
        assert_eq!(segmented.ledger.n_of(LedgerKind::TunnelClosed), count("tunnel_repairs"), "{name}");
    }
}

/// Voxels, components, voxels of the largest component, and of it with its cavities filled.
type Counts = (usize, usize, usize, usize);

/// Counted with nibabel 5 and SciPy's `label` (26 neighbours) and `binary_fill_holes` (6 neighbours).
const MASKS: [(&str, &str, Counts); 9] = [
    ("airquant_airway", "LPS", (51_005, 1, 51_005, 51_005)),
    ("exact09_case18_bronchi", "LPS", (170_383, 1, 170_383, 170_383)),
    ("kimimaro_neuron_28794499", "RAS", (1_446_575, 3, 1_432_482, 1_432_492)),
    ("medmpd_brain2_vessels", "RAS", (120_949, 245, 119_403, 119_496)),
    ("medmpd_liver3_hepatic_vein", "LPS", (17_714, 1, 17_714, 17_720)),
    ("medmpd_lungs1_bronchi", "RAS", (207_263, 1, 207_263, 207_263)),
    ("medmpd_lungs2_vessels", "RAS", (300_120, 10, 160_883, 160_906)),
    ("totalseg_pulmonary_airway", "LPS", (8_208, 1, 8_208, 8_212)),
    ("vmtk_aorta_levelset_mask", "RAS", (11_590, 1, 11_590, 11_590)),
];

#[test]
fn masks_are_counted_as_scipy_counts_them() {
    if data().is_none() {
        return;
    }
    for (name, orientation, expected) in MASKS {
        let loaded = load(&format!("{name}.nii.gz")).expect("data is set");
        assert!(matches!(inspect_kind(&loaded.volume), Kind::Mask { .. }), "{name}");
        assert_eq!(loaded.volume.grid().orientation(), orientation, "{name}");
        let params = Params {
            components: Components::Largest,
            close_tunnels: false,
            thick_slices: 0.0,
            ..Params::default()
        };
        let segmented = segment(&loaded.volume, &params).expect("a mask");
        let count = |key| segmented.report.get(key).unwrap_or(f64::NAN) as usize;
        let found = (
            count("selected_voxels"),
            count("components"),
            count("component_largest_voxels"),
            segmented.mask.n_foreground(),
        );
        assert_eq!(found, expected, "{name}");
        // One entry for each dropped component, and one for those beyond 200.
        let n_dropped = expected.1 - 1;
        assert_eq!(segmented.ledger.0.len(), n_dropped.min(200) + usize::from(n_dropped > 200), "{name}");
    }
}

/// The vessels of two lungs are two trees and a part of one; of the other masks nothing but the largest component stays.
#[test]
fn two_lungs_stay() {
    if data().is_none() {
        return;
    }
    for (name, _, (_, n_components, largest, _)) in MASKS {
        let loaded = load(&format!("{name}.nii.gz")).expect("data is set");
        let params =
            Params { close_tunnels: false, fill_cavities: false, thick_slices: 0.0, ..Params::default() };
        let segmented = segment(&loaded.volume, &params).expect("a mask");
        let (n_kept, n_voxels) = match name {
            "medmpd_lungs2_vessels" => (3, 160_883 + 107_612 + 19_105),
            _ => (1, largest),
        };
        assert_eq!(segmented.mask.n_foreground(), n_voxels, "{name}");
        assert_eq!(
            segmented.report.get("components_dropped"),
            Some((n_components - n_kept) as f64),
            "{name}"
        );
    }
}

#[test]
fn scans_and_label_maps_need_a_method() {
    if data().is_none() {
        return;
    }
    for name in ["ct_avm_head_cta.nii.gz", "totalseg_pulmonary_ct.nii.gz"] {
        let loaded = load(name).expect("data is set");
        let error = segment(&loaded.volume, &Params::default()).expect_err("a CT needs a method");
        assert_eq!((error.code(), error.class().exit_code()), ("E-VOLUME-METHOD", 2), "{name}");
    }
    let labels = load("totalseg_example_labels.nii.gz").expect("data is set");
    let Kind::Labels { values } = inspect_kind(&labels.volume) else { panic!("not a label map") };
    assert_eq!(values.len(), 42);
    let error = segment(&labels.volume, &Params::default()).expect_err("a label map needs a label");
    assert!(error.hint().contains("as in --set volume.label=1;"), "{}", error.hint());
    let params = Params { label: Some(117.0.into()), components: Components::All, ..Params::default() };
    assert!(segment(&labels.volume, &params).expect("label 117").mask.n_foreground() > 0);
    // By name: 117 is the last class of the task `total`.
    let by_name = |name: &str| {
        segment(&labels.volume, &Params { label: Some(Labels::parse(name)), ..Params::default() })
    };
    let named = by_name("spleen, costal_cartilages").expect("both");
    assert_eq!(named.report.warnings.len(), 2);
    let by_value = by_name("1,117").expect("both");
    assert_eq!(named.mask, by_value.mask);
    assert_eq!(by_name("lung_vessels").expect_err("another task").code(), "E-VOLUME-LABEL-ABSENT");
    let error = by_name("hart").expect_err("unknown");
    assert!(error.to_string().contains("heart"), "{error}");
    let error = segment(&labels.volume, &Params { label: Some(999.0.into()), ..Params::default() })
        .expect_err("none");
    assert_eq!((error.code(), error.class().exit_code()), ("E-VOLUME-EMPTY", 3));
}

/// The threshold of 200 that the data's own notes give, on bytes with a slope.
#[test]
fn threshold_works_on_scaled_values() {
    let Some(loaded) = load("ct_avm_head_cta.nii.gz") else { return };
    let params = Params {
        method: Method::Threshold,
        lower: Some(200.0),
        components: Components::All,
        fill_cavities: false,
        close_tunnels: false,
        ..Params::default()
    };
    let segmented = segment(&loaded.volume, &params).expect("vessels");
    let n_by_hand = loaded.volume.map_values(|v| usize::from(v >= 200.0)).iter().sum::<usize>();
    assert_eq!(segmented.mask.n_foreground(), n_by_hand);
    assert_eq!(n_by_hand, 98_873);
}

/// A mask straight from the file is that of the whole volume, with the same report.
#[test]
fn streamed_masks_equal_those_of_whole_volumes() {
    let Some(data) = data() else { return };
    let any = || Params { components: Components::All, fill_cavities: false, ..Params::default() };
    let band = Params { method: Method::Threshold, lower: Some(200.0), ..any() };
    let cases = [
        ("airquant_airway.nii.gz", any()),
        ("kimimaro_neuron_28794499.nii.gz", any()),
        ("vmtk_aorta_levelset_mask.nii.gz", Params { method: Method::Mask, ..any() }),
        ("ct_avm_head_cta.nii.gz", band.clone()),
        ("vmtk_aorta.mha", band.clone()),
        ("cip_ct64.nrrd", Params { upper: Some(-900.0), ..band }),
        ("totalseg_example_labels.nii.gz", Params { label: Some(117.0.into()), ..any() }),
        ("totalseg_pulmonary_ct.nii.gz", airway_params(-865.0)),
    ];
    for (name, params) in cases {
        let path = data.join("volumes").join(name);
        let loaded = read(&path, &ReadOptions::default()).expect("readable");
        let whole = segment(&loaded.volume, &params).map_err(|error| error.to_string());
        let streamed = read_mask(&path, &ReadOptions::default(), &params).map_err(|error| error.to_string());
        let whole = whole.map(|whole| {
            let mut report = loaded.report;
            report.extend(whole.report);
            Segmented { report, ..whole }
        });
        assert_eq!(streamed, whole, "{name}");
    }
}

/// Piece by piece a volume has the values that it has at once, whatever its format.
#[test]
fn pieces_are_those_of_whole_volumes() {
    let Some(data) = data() else { return };
    let names = ["ct_avm_head_cta.nii.gz", "vmtk_aorta.mha", "cip_ct64.nrrd", "cip_ct64_dicom_series"];
    for name in names {
        let path = data.join("volumes").join(name);
        let whole = read(&path, &ReadOptions::default()).expect("readable").volume;
        let pieces = open_pieces(&path, &ReadOptions::default()).expect("readable");
        assert_eq!(pieces.grid(), whole.grid(), "{name}");
        let mut values = Vec::new();
        pieces
            .for_each(|start, piece| {
                assert_eq!(start, values.len());
                values.extend_from_slice(piece);
            })
            .expect("readable");
        assert!(values == whole.map_values(|value| value), "{name}");
    }
}
