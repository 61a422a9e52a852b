//! Same inputs, config and seed: the same bytes, whatever the threads, the folder, or where the run begins.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

use std::path::{Path, PathBuf};

use espalier_pipeline::Stage;
use espalier_tests::{run, run_from, set, small_swarm};

fn pipelines() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../pipelines")
}

/// A small phantom, so that four runs of it are quick in a debug build.
fn quick() -> Vec<espalier_pipeline::Override> {
    let mut overrides = small_swarm();
    overrides.extend([set("phantom.spacing_mm", "[2.0, 2.0, 2.0]"), set("phantom.generations", 4)]);
    overrides
}

#[test]
fn threads_and_folders_do_not_matter() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let config = pipelines().join("airway.toml");
    let digests: Vec<String> = [("one", 1), ("two", 2), ("three", 3)]
        .map(|(name, threads)| {
            run(&config, &folder.path().join(name), &quick(), threads).expect("a run").digest
        })
        .into();
    assert_eq!(digests[0], digests[1]);
    assert_eq!(digests[0], digests[2]);
}

#[test]
fn a_run_from_the_middle_equals_one_from_the_start() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let config = pipelines().join("airway.toml");
    let whole = run(&config, folder.path(), &quick(), 2).expect("a run").digest;
    for from in [
        Stage::Volume,
        Stage::Skeleton,
        Stage::Radius,
        Stage::Tree,
        Stage::Views,
        Stage::Embed,
        Stage::Render,
    ] {
        let again = run_from(&config, folder.path(), &quick(), from).expect("a run");
        assert_eq!(again.digest, whole, "from {from}");
    }
}

#[test]
fn the_seed_matters() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let config = pipelines().join("neuron.toml");
    let digest = |seed: u64| {
        let mut overrides = small_swarm();
        overrides.push(set("seed", seed));
        run(&config, &folder.path().join(seed.to_string()), &overrides, 2).expect("a run").digest
    };
    assert_ne!(digest(1), digest(2));
}

#[test]
fn an_altered_file_is_noticed_and_later_results_go_with_their_cause() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let config = pipelines().join("neuron.toml");
    run(&config, folder.path(), &small_swarm(), 2).expect("a run");
    let tree_file = folder.path().join("tree.swc");
    let text = std::fs::read_to_string(&tree_file).expect("tree");
    std::fs::write(&tree_file, text.replace(" 1\n", " 1 \n")).expect("write");
    let refusal =
        run_from(&config, folder.path(), &small_swarm(), Stage::Views).expect_err("an altered tree");
    assert!(refusal.to_string().contains("tree.swc"), "{refusal}");

    // Again from the tree stage on, with another tree: what came from the old one must not stay.
    let mut coarser = small_swarm();
    coarser.push(set("tree.resample", "shape"));
    let mut request_to_tree = coarser.clone();
    request_to_tree.push(set("seed", 7));
    run(&config, folder.path(), &request_to_tree, 2).expect("a run");
    assert!(folder.path().join("planar.png").exists());
}
