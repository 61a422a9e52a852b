//! The whole way on other people's scans, masks and neurons: certified, and plausible.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

use std::path::{Path, PathBuf};

use espalier_model::{Tree, swc};
use espalier_pipeline::{Override, Stage, verify};
use espalier_tests::{real_data, results, run, run_range, set, small_swarm};

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

/// With little work: `scripts/bench-embed` gives it the whole.
#[test]
fn hemibrain_neuron() {
    let voxels = [
        set("input.unit", "nm"),
        set("input.scale", "[8.0, 8.0, 8.0]"),
        set("embed.pso.particles", 8),
        set("embed.pso.iterations", 1),
        set("embed.solver.effort", 0.01),
    ];
    check("neurons/hemibrain_722817260.swc", &voxels, &Expected { tips: 300..=3000, length_mm: 0.5..=20.0 });
}

/// Every well-formed traced neuron, with little work: certified. `scripts/bench-embed` gives them the whole.
#[test]
fn every_neuron_is_certified() {
    use espalier_embed::{Method, Params, SolverParams, embed};
    use espalier_views::find_views;

    /// Larger ones take minutes in a debug build.
    const MOST_NODES: usize = 1000;
    let Some(data) = real_data() else { return };
    let mut n_trees = 0;
    for file in swc_files(&data.join("neurons")) {
        let Some(tree) = traced_tree(&file).filter(|tree| tree.n_nodes() <= MOST_NODES) else { continue };
        let views = find_views(&tree, &espalier_views::Params::default(), 0).expect("views").hierarchy;
        let solver = SolverParams { effort: 0.01, ..SolverParams::default() };
        let params = Params { method: Method::Solver, methods: Vec::new(), solver, ..Params::default() };
        let embedding = embed(&tree, &views, &params, 0, &|_| {}).expect("a layout").embedding;
        let found = espalier_verify::meetings(&tree, &embedding.positions_mm);
        assert_eq!((embedding.certificate.crossings, found.count), (0, 0), "{}", file.display());
        n_trees += 1;
    }
    assert!(n_trees >= 50, "{n_trees} trees in the data");
}

/// Every `.swc` file in a folder and below, in a fixed order.
fn swc_files(folder: &Path) -> Vec<PathBuf> {
    let (mut files, mut folders) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("folder") {
            let path = entry.expect("entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "swc") {
                files.push(path);
            }
        }
    }
    files.sort();
    files
}

/// The tree of a traced neuron; `None` if the file is not well-formed.
fn traced_tree(file: &Path) -> Option<Tree> {
    let bytes = std::fs::read(file).expect("bytes");
    let (traced, _) = swc::parse(&bytes, &swc::SwcScale::micrometres()).ok()?;
    Some(espalier_tree::from_traced(&traced, &espalier_tree::Params::default()).ok()?.tree)
}

/// A run whose folder says nothing that does not hold.
#[track_caller]
fn verified(input: &str, overrides: &[Override]) {
    let Some(data) = real_data() else { return };
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut all = small_swarm();
    all.push(set("embed.solver.effort", 0.01));
    all.extend(overrides.iter().cloned());
    run_range(&data.join(input), folder.path(), &all, (None, Some(Stage::Embed))).expect("a run");
    let verification = verify(folder.path(), Some(2)).expect("a readable folder");
    verification.verdict().expect("every claim holds");
}

#[test]
fn airways_of_others() {
    verified("volumes/airquant_airway.nii.gz", &[set("tree.root", "superior")]);
    verified("volumes/totalseg_pulmonary_airway.nii.gz", &[set("tree.root", "superior")]);
    verified("volumes/medmpd_lungs1_bronchi.nii.gz", &[]);
}

#[test]
fn vessels_with_hundreds_of_loops() {
    verified("volumes/medmpd_brain2_vessels.nii.gz", &[]);
    verified("volumes/medmpd_lungs2_vessels.nii.gz", &[]);
    verified(
        "volumes/ct_avm_head_cta.nii.gz",
        &[set("volume.method", "threshold"), set("volume.lower", 200)],
    );
}
