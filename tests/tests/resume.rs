//! A run on a folder that has results already: what stands is kept, what a change reaches is done again, and nothing that
//! was altered is taken for a result.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

use std::fs;
use std::path::{Path, PathBuf};

use espalier_geom::random::{Purpose, Stream};
use espalier_model::Diagnose;
use espalier_pipeline::{Override, Stage, verify};
use espalier_tests::{run, run_from, run_seen, set, small_swarm};
use tempfile::TempDir;

fn config(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../pipelines").join(name)
}

/// A small neuron with small pictures.
fn quick() -> Vec<Override> {
    let mut overrides = small_swarm();
    overrides.extend([
        set("phantom.n_nodes", 60),
        set("embed.methods", "[\"radial\"]"),
        set("render.width_px", 256),
    ]);
    overrides
}

fn with(overrides: &[Override], key: &str, value: &str) -> Vec<Override> {
    overrides.iter().cloned().chain([set(key, value)]).collect()
}

#[test]
fn what_stands_is_kept() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let neuron = config("neuron.toml");
    let (first, done) = run_seen(&neuron, folder.path(), &quick()).expect("a run");
    assert_eq!(done.len(), 6, "{done:?}");
    let (second, done) = run_seen(&neuron, folder.path(), &quick()).expect("a run");
    assert_eq!(done, [], "nothing has changed");
    assert_eq!(first.digest, second.digest);
}

#[test]
fn a_change_reaches_what_reads_it_and_no_more() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let (neuron, fresh) = (config("neuron.toml"), folder.path().join("fresh"));
    let shared = folder.path().join("shared");
    run(&neuron, &shared, &quick(), 2).expect("a run");
    for (key, value, reached) in [
        ("render.theme", "dark", [Stage::Render, Stage::Report].as_slice()),
        ("embed.w_angle", "3", &[Stage::Embed, Stage::Render, Stage::Report]),
        ("report.enabled", "false", &[Stage::Report]),
    ] {
        let overrides = with(&quick(), key, value);
        let (changed, done) = run_seen(&neuron, &shared, &overrides).expect("a run");
        assert_eq!(done, reached, "{key}");
        let _ = fs::remove_dir_all(&fresh);
        assert_eq!(changed.digest, run(&neuron, &fresh, &overrides, 2).expect("a run").digest, "{key}");
        run(&neuron, &shared, &quick(), 2).expect("a run");
    }
}

#[test]
fn another_seed_leaves_nothing_of_the_first() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let (neuron, fresh) = (config("neuron.toml"), folder.path().join("fresh"));
    let shared = folder.path().join("shared");
    run(&neuron, &shared, &quick(), 2).expect("a run");
    let overrides = with(&quick(), "seed", "5");
    let (summary, done) = run_seen(&neuron, &shared, &overrides).expect("a run");
    assert_eq!(done.len(), 6, "{done:?}");
    assert_eq!(summary.digest, run(&neuron, &fresh, &overrides, 2).expect("a run").digest);
}

/// What is kept says of the folder only what the folder says of itself, until new results are there.
#[test]
fn a_run_that_fails_after_what_it_kept_leaves_a_whole_folder() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let swc = folder.path().join("fork.swc");
    fs::write(&swc, "1 1 0 0 0 3 -1\n2 3 0 9 0 2 1\n3 3 9 18 4 1 2\n4 3 -9 18 -4 1 2\n").expect("write");
    let edits = folder.path().join("edits.json");
    fs::write(&edits, "{").expect("write");
    let out = folder.path().join("out");
    let first = run(&swc, &out, &quick(), 2).expect("a run").digest;
    // Another name: all but the pictures is kept; with edits that are none, the embedding cannot be made.
    let failing = with(&with(&quick(), "name", "other"), "embed.edits", &format!("{edits:?}"));
    let (_, done) = run_seen(&swc, &out, &with(&quick(), "name", "other")).expect("a run");
    assert!(
        !done.contains(&Stage::Tree) && !done.contains(&Stage::Embed),
        "a name is the picture's: {done:?}"
    );
    run_seen(&swc, &out, &failing).expect_err("no edits");
    verify(&out, Some(1)).expect("a folder").verdict().expect("a folder that holds");
    let (again, _) = run_seen(&swc, &out, &quick()).expect("a run");
    assert_eq!(again.digest, first);
}

#[test]
fn a_tree_that_was_altered_is_not_built_on() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let neuron = config("neuron.toml");
    run(&neuron, folder.path(), &quick(), 2).expect("a run");
    let tree = folder.path().join("tree.swc");
    let text = fs::read_to_string(&tree).expect("a file");
    fs::write(&tree, text + "# a note\n").expect("write");
    let error = run_from(&neuron, folder.path(), &quick(), Stage::Embed).expect_err("an altered tree");
    assert_eq!(error.code(), "E-RUN-ALTERED-FILE");
}

/// The data of a header counts, not the header alone.
#[test]
fn a_volume_of_two_files_is_known_by_both() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let header = "ObjectType = Image\nNDims = 3\nDimSize = 4 4 12\nElementSpacing = 1 1 1\n\
                  ElementType = MET_UCHAR\nElementDataFile = mask.raw\n";
    let data = |last: u8| -> Vec<u8> {
        let inside = |i: usize| {
            (1..3).contains(&(i % 4)) && (1..3).contains(&(i / 4 % 4)) && (1..11).contains(&(i / 16))
        };
        (0..192).map(|i| if i == 166 { last } else { u8::from(inside(i)) }).collect()
    };
    fs::write(folder.path().join("mask.mhd"), header).expect("write");
    let to_skeleton = |last: u8| {
        fs::write(folder.path().join("mask.raw"), data(last)).expect("write");
        let (_, done) =
            run_seen(&folder.path().join("mask.mhd"), &folder.path().join("out"), &quick()).expect("a run");
        done
    };
    assert!(to_skeleton(1).contains(&Stage::Volume));
    assert_eq!(to_skeleton(1), []);
    assert!(to_skeleton(0).contains(&Stage::Volume), "the data has changed");
}

/// Every file of a run folder but those that hold times.
fn files_of(folder: &Path) -> Vec<PathBuf> {
    let (mut files, mut open) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() { open.push(path) } else { files.push(path) }
        }
    }
    let holds_times = |path: &PathBuf| {
        path.ends_with("run.json") || path.ends_with("timings.tsv") || path.ends_with(".lock")
    };
    files.retain(|path| !holds_times(path));
    files.sort();
    files
}

/// Damages a file: a flipped bit, a lost end, or the content of another file.
fn damage(path: &Path, other: &Path, key: u32) {
    let mut random = Stream::new(11, Purpose::Test, 0, key);
    let mut bytes = fs::read(path).expect("a file");
    let place = random.below(bytes.len().max(1) as u32) as usize;
    match key % 3 {
        0 => bytes[place] ^= 1 << random.below(8),
        1 => bytes.truncate(place),
        _ => bytes = fs::read(other).expect("a file"),
    }
    fs::write(path, bytes).expect("a file");
}

/// Damage to any file is seen by `verify` and mended by the next run. `ESPALIER_DAMAGES` for more of them.
#[test]
fn damage_is_seen_and_mended() {
    let folder: TempDir = tempfile::tempdir().expect("temporary folder");
    let neuron = config("neuron.toml");
    let whole = run(&neuron, folder.path(), &quick(), 2).expect("a run").digest;
    let files = files_of(folder.path());
    let mut random = Stream::new(11, Purpose::Test, 1, 0);
    for key in 0..n_damages() {
        let pick = |random: &mut Stream| &files[random.below(files.len() as u32) as usize];
        let (path, other) = (pick(&mut random), pick(&mut random));
        let before = fs::read(path).expect("a file");
        damage(path, other, key);
        if fs::read(path).expect("a file") == before {
            continue;
        }
        let is_seen = verify(folder.path(), Some(1)).is_ok_and(|found| found.verdict().is_ok());
        assert!(!is_seen, "damage {key} to {} passes", path.display());
        let mended = run(&neuron, folder.path(), &quick(), 2).expect("a run").digest;
        assert_eq!(mended, whole, "damage {key} to {}", path.display());
    }
}

#[allow(clippy::disallowed_methods, reason = "a test's size")]
fn n_damages() -> u32 {
    std::env::var("ESPALIER_DAMAGES").ok().and_then(|text| text.parse().ok()).unwrap_or(20)
}
