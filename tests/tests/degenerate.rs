//! Trees at the borders of what a tree can be, through all stages: a certified picture that `verify` cannot fault.
#![allow(clippy::expect_used, clippy::panic, reason = "a test says what it expects")]

use std::fs;

use espalier_pipeline::verify;
use espalier_tests::degenerate::cases;
use espalier_tests::{results, run, set, small_swarm};

/// Of the full size: chains of 400 nodes, stars of 4 and 40, a binary tree of 8 levels.
const SHARE: f64 = 0.004;

#[test]
fn every_degenerate_tree_is_drawn() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut overrides = small_swarm();
    overrides.extend([set("embed.solver.effort", 0.05), set("input.unit", "mm")]);
    for (idx, (name, swc)) in cases(SHARE).into_iter().enumerate() {
        let file = folder.path().join(format!("{idx}.swc"));
        fs::write(&file, swc).expect("write");
        let out = folder.path().join(idx.to_string());
        run(&file, &out, &overrides, 2).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(results(&out).1.certificate.holds(), "{name}");
        let failed = verify(&out, Some(2)).expect("a readable folder").verdict();
        assert!(failed.is_ok(), "{name}: {failed:?}");
    }
}
