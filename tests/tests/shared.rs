//! Runs that share their results: what another run has made is copied and not made again, whatever becomes of either folder,
//! and damage to the store is noticed.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

use std::fs;
use std::path::{Path, PathBuf};

use espalier_geom::random::{Purpose, Stream};
use espalier_pipeline::{Cache, Override, Stage, verify};
use espalier_tests::{run, run_sharing, set, small_swarm};

fn neuron() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../pipelines/neuron.toml")
}

/// A small neuron with small pictures.
fn quick() -> Vec<Override> {
    let mut overrides = small_swarm();
    overrides.extend([
        set("phantom.n_nodes", 40),
        set("embed.methods", "[\"radial\"]"),
        set("render.width_px", 256),
    ]);
    overrides
}

fn cache(folder: &Path) -> Cache {
    Cache { folder: folder.join("cache"), max_bytes: 1 << 30 }
}

/// Every file below a folder that holds results.
fn files_below(folder: &Path) -> Vec<PathBuf> {
    let (mut files, mut open) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() { open.push(path) } else { files.push(path) }
        }
    }
    files.retain(|path| !path.ends_with(".lock") && !path.ends_with("CACHEDIR.TAG"));
    files.sort();
    files
}

#[test]
fn a_run_that_agrees_makes_nothing() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let cache = cache(folder.path());
    let out = |name: &str| folder.path().join(name);
    let (first, done, taken) = run_sharing(&neuron(), &out("a"), &quick(), &cache).expect("a run");
    assert_eq!((done.len(), taken.len()), (6, 0));
    let (second, done, taken) = run_sharing(&neuron(), &out("b"), &quick(), &cache).expect("a run");
    assert_eq!((done.len(), taken.len()), (0, 6), "{done:?}");
    assert_eq!(first.digest, second.digest);
    verify(&out("b"), Some(1)).expect("a folder").verdict().expect("a folder that holds");
    assert!(out("b/provenance/run.json").exists());

    // What stands is not even looked for.
    let (_, done, taken) = run_sharing(&neuron(), &out("b"), &quick(), &cache).expect("a run");
    assert_eq!((done.len(), taken.len()), (0, 0));
}

#[test]
fn a_run_that_agrees_up_to_a_stage_goes_on_from_there() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let cache = cache(folder.path());
    let out = |name: &str| folder.path().join(name);
    run_sharing(&neuron(), &out("a"), &quick(), &cache).expect("a run");
    let other: Vec<Override> = quick().into_iter().chain([set("embed.w_angle", 3)]).collect();
    let (shared, done, taken) = run_sharing(&neuron(), &out("b"), &other, &cache).expect("a run");
    assert_eq!(taken, [Stage::Phantom, Stage::Tree, Stage::Views]);
    assert_eq!(done, [Stage::Embed, Stage::Render, Stage::Report]);
    assert_eq!(shared.digest, run(&neuron(), &out("fresh"), &other, 2).expect("a run").digest);
}

/// Flipped, cut or exchanged files of the store: another run sees it, and mends it. `ESPALIER_DAMAGES` for more of them.
#[test]
fn a_damaged_store_harms_nothing() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let cache = cache(folder.path());
    let (kept, other) = (folder.path().join("kept"), folder.path().join("other"));
    let whole = run_sharing(&neuron(), &kept, &quick(), &cache).expect("a run").0.digest;
    let mut random = Stream::new(12, Purpose::Test, 0, 0);
    let files = files_below(&cache.folder);
    for key in 0..n_damages() {
        let mut pick = || &files[random.below(files.len() as u32) as usize];
        let (path, exchanged) = (pick(), pick());
        let before = fs::read(path).expect("a file");
        let mut bytes = before.clone();
        let place = random.below(bytes.len().max(1) as u32) as usize;
        match key % 3 {
            0 => bytes[place] ^= 1 << random.below(8),
            1 => bytes.truncate(place),
            _ => bytes = fs::read(exchanged).expect("a file"),
        }
        if bytes == before {
            continue;
        }
        fs::write(path, bytes).expect("write");
        let _ = fs::remove_dir_all(&other);
        let (mended, done, _) = run_sharing(&neuron(), &other, &quick(), &cache).expect("a run");
        assert_eq!(mended.digest, whole, "damage {key} to {}", path.display());
        assert_eq!(done.len(), 1, "damage {key} to {} is not seen: {done:?}", path.display());
        assert_eq!(fs::read(path).expect("a file"), before, "damage {key} is not mended");
    }
    // Nothing of this has reached the results that the store was made from.
    verify(&kept, Some(1)).expect("a folder").verdict().expect("a folder that holds");
}

#[test]
fn damaged_results_are_not_shared() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let cache = cache(folder.path());
    let (a, b) = (folder.path().join("a"), folder.path().join("b"));
    let whole = run_sharing(&neuron(), &a, &quick(), &cache).expect("a run").0.digest;
    for path in files_below(&a).iter().filter(|path| path.extension().is_some()) {
        fs::write(path, "damaged").expect("write");
    }
    assert_eq!(run_sharing(&neuron(), &b, &quick(), &cache).expect("a run").0.digest, whole);
    let (mended, done, _) = run_sharing(&neuron(), &a, &quick(), &cache).expect("a run");
    assert_eq!((mended.digest, done.len()), (whole, 0));
}

#[test]
fn runs_that_share_at_the_same_time_agree() {
    let folder = tempfile::tempdir().expect("temporary folder");
    // So small that every run makes room while others store and take.
    for max_bytes in [1 << 30, 100_000] {
        let cache = Cache { max_bytes, ..cache(folder.path()) };
        let digests: Vec<String> = std::thread::scope(|scope| {
            let start = |idx: usize| {
                let out = folder.path().join(format!("{max_bytes}-{idx}"));
                let cache = &cache;
                scope.spawn(move || run_sharing(&neuron(), &out, &quick(), cache).expect("a run").0.digest)
            };
            let runs: Vec<_> = (0..4).map(start).collect();
            runs.into_iter().map(|run| run.join().expect("a thread")).collect()
        });
        assert!(digests.iter().all(|digest| *digest == digests[0]), "{digests:?}");
        let next = run_sharing(&neuron(), &folder.path().join(format!("{max_bytes}")), &quick(), &cache);
        assert!(next.is_ok_and(|(summary, ..)| summary.digest == digests[0]));
    }
}

#[test]
fn a_store_that_cannot_be_written_to_stops_no_run() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let file = folder.path().join("a-file");
    fs::write(&file, "no folder").expect("write");
    let cache = Cache { folder: file, max_bytes: 1 << 30 };
    let (shared, done, _) =
        run_sharing(&neuron(), &folder.path().join("out"), &quick(), &cache).expect("a run");
    assert_eq!(done.len(), 6);
    assert_eq!(
        shared.digest,
        run(&neuron(), &folder.path().join("alone"), &quick(), 2).expect("a run").digest
    );
}

#[allow(clippy::disallowed_methods, reason = "a test's size")]
fn n_damages() -> u32 {
    std::env::var("ESPALIER_DAMAGES").ok().and_then(|text| text.parse().ok()).unwrap_or(12)
}
