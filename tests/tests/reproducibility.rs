//! Same inputs, config and seed: the same bytes, whatever the threads, the folder, or where the run begins.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

use std::fs;
use std::path::{Path, PathBuf};

use espalier_model::Diagnose;
use espalier_pipeline::{Override, Stage};
use espalier_tests::{results, run, run_from, run_range, set, small_swarm};
use tempfile::TempDir;

fn pipelines() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../pipelines")
}

/// A small phantom, so that four runs of it are quick in a debug build.
fn quick() -> Vec<Override> {
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

/// The solver with all its parts at work: the sides of turns as they are, so that the targets cross.
fn with_solver(mirrors: bool) -> Vec<Override> {
    let mut overrides = small_swarm();
    overrides.extend([
        set("embed.solver.mirrors", mirrors),
        set("embed.solver.effort", 0.05),
        set("phantom.n_nodes", 400),
        set("seed", 2),
    ]);
    overrides
}

#[test]
fn threads_do_not_matter_to_the_solver() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let config = pipelines().join("neuron.toml");
    for mirrors in [true, false] {
        let digests: Vec<String> = [1, 2, 3, 16]
            .map(|threads| {
                let out = folder.path().join(format!("{mirrors}-{threads}"));
                run(&config, &out, &with_solver(mirrors), threads).expect("a run").digest
            })
            .into();
        assert!(digests.iter().all(|digest| *digest == digests[0]), "mirrors {mirrors}: {digests:?}");
    }
    // There was something to solve.
    let (_, embedding) = results(&folder.path().join("false-1"));
    let row = |method: &str| embedding.methods.iter().find(|row| row.method == method).expect(method);
    let (solver, cone) = (row("solver"), row("cone"));
    assert!(solver.energy.length + solver.energy.angle > 0.0 && solver.evaluations > 0);
    assert!(solver.energy.total() < 0.5 * cone.energy.total());
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
        Stage::Report,
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

/// A neuron's run in a folder of its own.
fn neuron_run(overrides: &[Override]) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("temporary folder");
    let config = pipelines().join("neuron.toml");
    run(&config, folder.path(), &with(overrides), 2).expect("a run");
    (folder, config)
}

fn with(overrides: &[Override]) -> Vec<Override> {
    small_swarm().into_iter().chain(overrides.iter().cloned()).collect()
}

/// The files that the folder vouches for, each checked to be there.
fn vouched(folder: &Path) -> Vec<String> {
    let sums = fs::read_to_string(folder.join("SHA256SUMS")).expect("SHA256SUMS");
    let files: Vec<String> =
        sums.lines().filter_map(|line| Some(line.split_once("  ")?.1.to_owned())).collect();
    assert!(files.iter().all(|file| folder.join(file).is_file()), "a file is vouched for that is not there");
    files
}

#[test]
fn an_altered_file_is_noticed() {
    let (folder, config) = neuron_run(&[]);
    let tree_file = folder.path().join("tree.swc");
    let text = fs::read_to_string(&tree_file).expect("tree");
    fs::write(&tree_file, text.replacen("# unit mm", "# unit mm ", 1)).expect("write");
    let refusal =
        run_from(&config, folder.path(), &small_swarm(), Stage::Views).expect_err("an altered tree");
    assert!(refusal.to_string().contains("tree.swc"), "{refusal}");
}

#[test]
fn later_results_go_with_what_they_were_made_from() {
    let (folder, config) = neuron_run(&[]);
    let same = run_range(&config, folder.path(), &small_swarm(), (None, Some(Stage::Tree)));
    assert!(same.is_ok() && folder.path().join("planar.png").exists(), "the same tree keeps its picture");

    let coarser = with(&[set("tree.resample", "shape")]);
    run_range(&config, folder.path(), &coarser, (None, Some(Stage::Tree))).expect("a run");
    let files = vouched(folder.path());
    assert!(files.contains(&"tree.swc".to_owned()));
    for gone in ["views.json", "embedding.json", "planar.png"] {
        assert!(
            !files.contains(&gone.to_owned()) && !folder.path().join(gone).exists(),
            "{gone} has outlived its tree"
        );
    }
}

#[test]
fn a_run_that_fails_leaves_no_mixture() {
    let (folder, config) = neuron_run(&[]);
    let other = with(&[set("seed", 9), set("embed.pso.memory_mib", 1), set("embed.pso.particles", 100_000)]);
    run(&config, folder.path(), &other, 2).expect_err("a swarm beyond its memory");
    assert!(!folder.path().join("embedding.json").exists(), "an embedding of another tree");
    let settings =
        fs::read_to_string(folder.path().join("provenance/config.resolved.toml")).expect("settings");
    assert!(settings.contains("seed = 9"));
    assert!(vouched(folder.path()).contains(&"views.json".to_owned()));
}

#[test]
fn a_run_from_the_middle_keeps_to_the_settings_it_builds_on() {
    let (folder, config) = neuron_run(&[]);
    for (key, value, stage) in [("tree.prune_factor", "9.0", "tree"), ("seed", "77", "phantom")] {
        let refusal =
            run_from(&config, folder.path(), &with(&[set(key, value)]), Stage::Embed).expect_err("refused");
        assert!(
            refusal.to_string().contains(key) && refusal.hint().contains(&format!("--from {stage}")),
            "{refusal}"
        );
    }
    run_from(&config, folder.path(), &with(&[set("embed.w_angle", 3)]), Stage::Embed).expect("a run");
}

#[test]
fn a_run_from_the_middle_keeps_to_its_input_whatever_its_name() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let scan = |patient: &str, tip: f64| {
        let path = folder.path().join(patient).join("traced.swc");
        fs::create_dir_all(path.parent().expect("a folder")).expect("folder");
        let text = format!("1 1 0 0 0 1 -1\n2 3 0 0 9 1 1\n3 3 4 0 {tip} 1 2\n4 3 -4 1 15 1 2\n");
        fs::write(&path, text).expect("write");
        path
    };
    let (first, second, out) = (scan("first", 15.0), scan("second", 16.0), folder.path().join("out"));
    run(&first, &out, &small_swarm(), 2).expect("a run");
    let refusal = run_from(&second, &out, &small_swarm(), Stage::Embed).expect_err("another patient");
    assert!(refusal.to_string().contains("second"), "{refusal}");
    run_from(&first, &out, &small_swarm(), Stage::Embed).expect("the same patient");
}

#[test]
fn another_input_leaves_nothing_of_the_former() {
    let (folder, _) = neuron_run(&[]);
    let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures/y.nii.gz");
    let mixed = run(&fixture, folder.path(), &small_swarm(), 2).expect("a run").digest;
    let fresh = tempfile::tempdir().expect("temporary folder");
    assert_eq!(run(&fixture, fresh.path(), &small_swarm(), 2).expect("a run").digest, mixed);
}

#[test]
fn the_way_a_path_is_typed_does_not_matter() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures");
    let digest = |path: PathBuf, out: &str| {
        run(&path, &folder.path().join(out), &small_swarm(), 2).expect("a run").digest
    };
    let detour = fixtures.join("../fixtures/neuron.swc");
    assert_eq!(digest(fixtures.join("neuron.swc"), "direct"), digest(detour, "detour"));
}
